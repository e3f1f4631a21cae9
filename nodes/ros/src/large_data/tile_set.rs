//! A set of tile indices.

/// A set of tile indices as a bit field: bit `i % 8` of byte `i / 8` stands for tile `i`, as in the
/// field `have` of `puffer_msgs/msg/TileAck`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct TileSet(Vec<u8>);

impl TileSet {
    /// The empty set, with room for the tiles 0 to `count - 1`.
    pub(crate) fn new(count: usize) -> TileSet {
        TileSet(vec![0; count.div_ceil(8)])
    }

    /// The set that an acknowledgement holds.
    pub(crate) fn from_bytes(bytes: Vec<u8>) -> TileSet {
        TileSet(bytes)
    }

    /// The set as an acknowledgement holds it.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.0
    }

    pub(crate) fn contains(&self, i: usize) -> bool {
        self.0.get(i / 8).is_some_and(|byte| byte >> (i % 8) & 1 == 1)
    }

    /// Adds `i`; an index beyond the set's room is left out.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_are_bits_from_the_lowest_of_the_first_byte_on() {
        let mut set = TileSet::new(10);
        assert!(set.is_empty() && set.bytes() == [0, 0]);
        for index in [0, 3, 9, 3] {
            set.insert(index);
        }
        assert_eq!(set.bytes(), [0b0000_1001, 0b0000_0010]);
        assert_eq!((set.len(), set.is_empty()), (3, false));
        let read = TileSet::from_bytes(set.bytes().to_vec());
        let members: Vec<usize> = (0..32).filter(|i| read.contains(*i)).collect();
        assert_eq!(members, [0, 3, 9]);
    }

    #[test]
    fn an_index_without_room_is_left_out() {
        let mut set = TileSet::new(8);
        set.insert(8);
        assert!(set.is_empty() && !set.contains(8));
        assert!(TileSet::new(0).bytes().is_empty());
    }
}
