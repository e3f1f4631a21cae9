//! A sample of which a reader has some tiles.

use super::tile::{MAX_TILE_BYTES, Tile, tile_count};
use super::tile_set::TileSet;
use bytes::Bytes;

/// The tiles of one sample that have arrived so far.
pub(crate) struct SampleAssembly {
    /// Sequence number of the sample.
    pub(crate) sequence: u64,
    tile_size: usize,
    checksum: u32,
    bytes: Vec<u8>,
    /// Tiles that have arrived.
    pub(crate) have: TileSet,
    /// Number of tiles that have not arrived.
    missing: usize,
}

/// What became of a tile.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum TileOutcome {
    /// The tile was missing, and is added.
    New,
    /// The tile was there already, or is an announcement.
    Known,
    /// The tile does not belong to this sample, or its data do not fit its checksum.
    Corrupt,
}

impl SampleAssembly {
    /// Prepares for the sample that `tile` is a part of.
    ///
    /// # Errors
    /// In words, if the sample is larger than `limit` bytes or its tiles have an impossible size.
    pub(crate) fn new(tile: &Tile, limit: u64) -> Result<SampleAssembly, String> {
        if tile.total > limit {
            return Err(format!("{} bytes, and {limit} is the limit", tile.total));
        }
        let size = tile.tile_size as usize;
        if !(1..=MAX_TILE_BYTES).contains(&size) {
            return Err(format!("tiles of {size} bytes, and {MAX_TILE_BYTES} is the limit"));
        }
        let count = tile_count(tile.total, tile.tile_size) as usize;
        Ok(SampleAssembly {
            sequence: tile.sequence,
            tile_size: size,
            checksum: tile.sample_checksum,
            bytes: vec![0; tile.total as usize],
            have: TileSet::new(count),
            missing: count,
        })
    }

    /// Adds a tile.
    pub(crate) fn add(&mut self, tile: &Tile) -> TileOutcome {
        let is_same_sample = tile.total == self.bytes.len() as u64
            && tile.tile_size as usize == self.tile_size
            && tile.sample_checksum == self.checksum;
        if !is_same_sample {
            return TileOutcome::Corrupt;
        }
        let index = tile.index as usize;
        let from = index * self.tile_size;
        if self.have.contains(index) || from >= self.bytes.len() {
            return TileOutcome::Known;
        }
        let to = (from + self.tile_size).min(self.bytes.len());
        if tile.data.len() != to - from || crc32fast::hash(&tile.data) != tile.checksum {
            return TileOutcome::Corrupt;
        }
        self.bytes[from..to].copy_from_slice(&tile.data);
        self.have.insert(index);
        self.missing -= 1;
        TileOutcome::New
    }

    pub(crate) fn is_complete(&self) -> bool {
        self.missing == 0
    }

    /// The complete sample.
    ///
    /// # Errors
    /// An empty assembly of the same sample, if the bytes do not fit the sample's checksum: all
    /// tiles are needed again.
    pub(crate) fn finish(mut self) -> Result<Bytes, SampleAssembly> {
        if crc32fast::hash(&self.bytes) == self.checksum {
            return Ok(self.bytes.into());
        }
        self.missing = tile_count(self.bytes.len() as u64, self.tile_size as u32) as usize;
        self.have = TileSet::new(self.missing);
        Err(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::large_data::pending_sample::PendingSample;

    const LIMIT: u64 = 1 << 20;

    fn tiles(length: usize) -> (Bytes, Vec<Tile>) {
        let bytes: Bytes = (0..length).map(|i| (i % 250) as u8).collect::<Vec<u8>>().into();
        let sample = PendingSample::new(1, bytes.clone());
        let tiles = (0..sample.tile_count()).map(|i| sample.tile(i, [1; 16], 1, 0)).collect();
        (bytes, tiles)
    }

    #[test]
    fn tiles_in_any_order_make_the_sample() {
        let (bytes, tiles) = tiles(3 * MAX_TILE_BYTES + 5);
        let mut assembly = SampleAssembly::new(&tiles[2], LIMIT).unwrap();
        for index in [2, 0, 3] {
            assert_eq!(assembly.add(&tiles[index]), TileOutcome::New);
            assert_eq!(assembly.add(&tiles[index]), TileOutcome::Known);
            assert!(!assembly.is_complete());
        }
        assert_eq!(assembly.have.bytes(), [0b1101]);
        assert_eq!(assembly.add(&tiles[1]), TileOutcome::New);
        assert!(assembly.is_complete());
        assert!(assembly.finish().ok().unwrap() == bytes);
    }

    #[test]
    fn a_tile_that_does_not_fit_changes_nothing() {
        let (_, tiles) = tiles(2 * MAX_TILE_BYTES);
        let mut assembly = SampleAssembly::new(&tiles[0], LIMIT).unwrap();
        let changes: [fn(&mut Tile); 5] = [
            |tile| tile.data[7] ^= 1,
            |tile| tile.data.truncate(10),
            |tile| tile.total += 1,
            |tile| tile.tile_size -= 1,
            |tile| tile.sample_checksum ^= 1,
        ];
        for change in changes {
            let mut tile = tiles[0].clone();
            change(&mut tile);
            assert_eq!(assembly.add(&tile), TileOutcome::Corrupt);
        }
        assert!(assembly.have.is_empty());
        let mut beyond = tiles[0].clone();
        beyond.index = 2;
        assert_eq!(assembly.add(&beyond), TileOutcome::Known, "an announcement");
    }

    #[test]
    fn impossible_sizes_are_refused_before_memory_is_taken() {
        let (_, tiles) = tiles(10);
        for (total, tile_size, reason) in [
            (LIMIT + 1, 1000, "is the limit"),
            (u64::MAX, 1, "is the limit"),
            (10, 0, "tiles of 0 bytes"),
            (10, MAX_TILE_BYTES as u32 + 1, "tiles of 60001 bytes"),
        ] {
            let tile = Tile { total, tile_size, ..tiles[0].clone() };
            let error = SampleAssembly::new(&tile, LIMIT).err().unwrap();
            assert!(error.contains(reason), "{error}");
        }
    }

    #[test]
    fn a_sample_of_the_wrong_checksum_starts_again() {
        let (_, mut tiles) = tiles(2 * MAX_TILE_BYTES);
        for tile in &mut tiles {
            tile.sample_checksum ^= 1;
        }
        let mut assembly = SampleAssembly::new(&tiles[0], LIMIT).unwrap();
        for tile in &tiles {
            assert_eq!(assembly.add(tile), TileOutcome::New);
        }
        let again = assembly.finish().err().unwrap();
        assert!(again.have.is_empty() && !again.is_complete());
    }
}
