//! What travels, and its limits.

use serde::{Deserialize, Serialize};

/// GUID of a DDS endpoint.
pub(crate) type Id = [u8; 16];

/// An acknowledgement to every writer.
pub(crate) const EVERYONE: Id = [0; 16];

/// Most bytes of data in a tile: with its header below the 64 KiB of a datagram, so that it travels unfragmented
/// over loopback.
pub(crate) const TILE_BYTES: usize = 60_000;

/// A piece of a sample; see `puffer_msgs/msg/Tile.msg`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Tile {
    pub(crate) writer: Id,
    pub(crate) sequence: u64,
    pub(crate) oldest: u64,
    pub(crate) after: u64,
    pub(crate) total: u64,
    pub(crate) tile_size: u32,
    pub(crate) index: u32,
    pub(crate) sample_checksum: u32,
    pub(crate) checksum: u32,
    #[serde(with = "serde_bytes")]
    pub(crate) data: Vec<u8>,
}

/// What a reader has; see `puffer_msgs/msg/TileAck.msg`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct TileAck {
    pub(crate) reader: Id,
    pub(crate) writer: Id,
    pub(crate) done: u64,
    pub(crate) sequence: u64,
    #[serde(with = "serde_bytes")]
    pub(crate) have: Vec<u8>,
    pub(crate) busy: bool,
}

/// Number of tiles of a sample.
pub(crate) fn tile_count(total: u64, tile_size: u32) -> u64 {
    total.div_ceil(u64::from(tile_size.max(1)))
}
