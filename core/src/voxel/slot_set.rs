//! Sets of voxels, one bit each.

/// Slots in a word of the set.
const WORD_BITS: usize = u64::BITS as usize;

/// A set of slots of a [`super::BlockGrid`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SlotSet {
    words: Vec<u64>,
}

impl SlotSet {
    /// An empty set for slots below `slots`.
    pub fn new(slots: usize) -> SlotSet {
        SlotSet { words: vec![0; slots.div_ceil(WORD_BITS)] }
    }

    /// Removes all slots.
    pub fn clear(&mut self) {
        self.words.fill(0);
    }

    /// Adds `slot`, and says whether it was not in the set before.
    pub fn insert(&mut self, slot: u32) -> bool {
        let (word, bit) =
            (&mut self.words[slot as usize / WORD_BITS], 1 << (slot as usize % WORD_BITS));
        let fresh = *word & bit == 0;
        *word |= bit;
        fresh
    }

    /// Whether `slot` is in the set.
    pub fn contains(&self, slot: u32) -> bool {
        self.words[slot as usize / WORD_BITS] & 1 << (slot as usize % WORD_BITS) != 0
    }

    /// Adds all slots of `other`, which must be made for as many slots.
    pub fn unite(&mut self, other: &SlotSet) {
        for (word, other) in self.words.iter_mut().zip(&other.words) {
            *word |= other;
        }
    }

    /// All slots of the set, ascending.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        self.words.iter().enumerate().flat_map(|(at, &word)| {
            let mut rest = word;
            std::iter::from_fn(move || {
                let bit = (rest != 0).then(|| rest.trailing_zeros())?;
                rest &= rest - 1;
                Some((at * WORD_BITS) as u32 + bit)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_kept_once_and_listed_in_order() {
        let mut set = SlotSet::new(1000);
        for slot in [700, 3, 64, 63, 999] {
            assert!(set.insert(slot));
        }
        assert!(!set.insert(64) && set.contains(64) && !set.contains(65));
        let mut other = SlotSet::new(1000);
        other.insert(5);
        set.unite(&other);
        assert_eq!(set.iter().collect::<Vec<_>>(), [3, 5, 63, 64, 700, 999]);
        set.clear();
        assert_eq!(set.iter().count(), 0);
    }
}
