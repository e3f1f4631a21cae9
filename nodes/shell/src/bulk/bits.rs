//! A set of tile numbers.

/// Bit `i % 8` of byte `i / 8` stands for tile `i`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Bits(Vec<u8>);

impl Bits {
    /// The empty set, with room for `count` tiles.
    pub(crate) fn new(count: usize) -> Bits {
        Bits(vec![0; count.div_ceil(8)])
    }

    /// From the wire.
    pub(crate) fn from_bytes(bytes: Vec<u8>) -> Bits {
        Bits(bytes)
    }

    /// For the wire.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.0
    }

    pub(crate) fn has(&self, i: usize) -> bool {
        self.0.get(i / 8).is_some_and(|byte| byte >> (i % 8) & 1 == 1)
    }

    /// Adds `i`; numbers beyond the set's room are left out.
    pub(crate) fn insert(&mut self, i: usize) {
        if let Some(byte) = self.0.get_mut(i / 8) {
            *byte |= 1 << (i % 8);
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.0.iter().map(|byte| byte.count_ones() as usize).sum()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.iter().all(|byte| *byte == 0)
    }
}
