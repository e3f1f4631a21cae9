//! What travels, and its limits.

pub(crate) use puffer_msgs::msg::{Tile, TileAck};

/// GUID of a DDS endpoint.
pub(crate) type Id = [u8; 16];

/// An acknowledgement to every writer.
pub(crate) const EVERYONE: Id = [0; 16];

/// Most bytes of data in a tile: with its header below the 64 KiB of a datagram, so that it travels unfragmented
/// over loopback.
pub(crate) const TILE_BYTES: usize = 60_000;

/// Number of tiles of a sample.
pub(crate) fn tile_count(total: u64, tile_size: u32) -> u64 {
    total.div_ceil(u64::from(tile_size.max(1)))
}
