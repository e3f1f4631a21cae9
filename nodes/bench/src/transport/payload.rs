//! Samples whose every byte follows from their number.

use bytes::Bytes;

/// Makes sample `index` of `size` bytes (at least 16). It starts with its number.
pub(super) fn make_payload(index: u64, size: usize) -> Bytes {
    let mut bytes = Vec::with_capacity(size + 8);
    bytes.extend(index.to_le_bytes());
    let start = mix_bits(index);
    let mut word = 0;
    while bytes.len() < size {
        bytes.extend(mix_bits(start.wrapping_add(word)).to_le_bytes());
        word += 1;
    }
    bytes.truncate(size);
    bytes.into()
}

/// The number of a sample, if every byte of it is correct.
pub(super) fn check_payload(bytes: &[u8], size: usize) -> Option<u64> {
    let index = u64::from_le_bytes(bytes.first_chunk().copied()?);
    let start = mix_bits(index);
    let mut words = bytes[8..].chunks(8).zip(0..);
    let right = words.all(|(chunk, word)| {
        mix_bits(start.wrapping_add(word)).to_le_bytes()[..chunk.len()] == *chunk
    });
    (bytes.len() == size && right).then_some(index)
}

/// Mixes bits: the finaliser of splitmix64 (Steele, Lea, Flood 2014, Fast Splittable Pseudorandom
/// Number Generators).
fn mix_bits(word: u64) -> u64 {
    let a = word.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let b = (a ^ a >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let c = (b ^ b >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    c ^ c >> 31
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_is_checked() {
        for size in [16, 29, 1000] {
            let good = make_payload(7, size);
            assert_eq!(check_payload(&good, size), Some(7));
            for i in 0..size {
                let mut bad = good.to_vec();
                bad[i] ^= 1;
                assert_eq!(check_payload(&bad, size), None, "byte {i} of {size}");
            }
            assert_eq!(check_payload(&good[..size - 1], size), None);
        }
    }
}
