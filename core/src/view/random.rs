//! Pseudo-random numbers that depend on their inputs alone.

/// SplitMix64's increment: 2^64 divided by the golden ratio, odd.
const GOLDEN_GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

/// A pseudo-random number from three others (SplitMix64; Steele et al. 2014).
pub(crate) fn hash_of_three(seed: u64, a: u64, b: u64) -> u64 {
    [a, b].into_iter().fold(mix(seed.wrapping_add(GOLDEN_GAMMA)), |x, y| {
        mix(x.wrapping_add(GOLDEN_GAMMA) ^ mix(y.wrapping_add(GOLDEN_GAMMA)))
    })
}

/// SplitMix64's finaliser.
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_finaliser_gives_the_published_sequence() {
        // The first outputs of SplitMix64 with the seed 1234567.
        let mut state = 1_234_567_u64;
        let outputs = [0, 1, 2].map(|_| {
            state = state.wrapping_add(GOLDEN_GAMMA);
            mix(state)
        });
        assert_eq!(
            outputs,
            [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]
        );
    }

    #[test]
    fn each_input_counts() {
        let numbers = [(1, 2, 3), (2, 2, 3), (1, 3, 3), (1, 2, 4), (3, 2, 1)]
            .map(|(s, a, b)| hash_of_three(s, a, b));
        for i in 1..numbers.len() {
            assert!(!numbers[..i].contains(&numbers[i]));
        }
    }
}
