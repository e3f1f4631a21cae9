//! A sample on its way in.

use super::bits::Bits;
use super::wire::{TILE_BYTES, Tile, tile_count};
use bytes::Bytes;

/// Tiles of one sample.
pub(crate) struct Assembly {
    pub(crate) sequence: u64,
    tile_size: usize,
    checksum: u32,
    bytes: Vec<u8>,
    pub(crate) have: Bits,
    missing: usize,
}

/// What became of a tile.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Put {
    /// It helped.
    New,
    /// It was there already, or is an announcement.
    Known,
    /// Its data are not what its checksum says, or do not fit.
    Corrupt,
}

impl Assembly {
    /// Prepares for the sample of `tile`; says what is wrong if its figures do not fit together.
    pub(crate) fn new(tile: &Tile, limit: u64) -> Result<Assembly, String> {
        if tile.total > limit {
            return Err(format!("{} bytes, and {limit} is the limit", tile.total));
        }
        let size = tile.tile_size as usize;
        if !(1..=TILE_BYTES).contains(&size) {
            return Err(format!("tiles of {size} bytes, and {TILE_BYTES} is the limit"));
        }
        let count = tile_count(tile.total, tile.tile_size) as usize;
        Ok(Assembly {
            sequence: tile.sequence,
            tile_size: size,
            checksum: tile.sample_checksum,
            bytes: vec![0; tile.total as usize],
            have: Bits::new(count),
            missing: count,
        })
    }

    /// Takes a tile of this sample.
    pub(crate) fn put(&mut self, tile: &Tile) -> Put {
        let same = tile.total == self.bytes.len() as u64
            && tile.tile_size as usize == self.tile_size
            && tile.sample_checksum == self.checksum;
        if !same {
            return Put::Corrupt;
        }
        let index = tile.index as usize;
        let from = index * self.tile_size;
        if self.have.has(index) || from >= self.bytes.len() {
            return Put::Known;
        }
        let to = (from + self.tile_size).min(self.bytes.len());
        if tile.data.len() != to - from || crc32fast::hash(&tile.data) != tile.checksum {
            return Put::Corrupt;
        }
        self.bytes[from..to].copy_from_slice(&tile.data);
        self.have.insert(index);
        self.missing -= 1;
        Put::New
    }

    pub(crate) fn is_complete(&self) -> bool {
        self.missing == 0
    }

    /// The sample, or what is wrong with it, after which all tiles are needed again.
    pub(crate) fn finish(mut self) -> Result<Bytes, Assembly> {
        if crc32fast::hash(&self.bytes) == self.checksum {
            return Ok(self.bytes.into());
        }
        self.missing = tile_count(self.bytes.len() as u64, self.tile_size as u32) as usize;
        self.have = Bits::new(self.missing);
        Err(self)
    }
}
