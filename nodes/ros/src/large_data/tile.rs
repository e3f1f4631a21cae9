//! The messages of the protocol, and their limits.

pub(crate) use puffer_msgs::msg::{Tile, TileAck};

/// GUID of a DDS endpoint.
pub(crate) type EndpointId = [u8; 16];

/// The writer that an acknowledgement names if it is meant for every writer.
pub(crate) const ALL_WRITERS: EndpointId = [0; 16];

/// Largest number of data bytes in a tile: with its header it stays below the 64 KiB of a UDP
/// datagram, so that it travels unfragmented over loopback.
pub(crate) const MAX_TILE_BYTES: usize = 60_000;

/// Number of tiles of a sample of `total` bytes in tiles of `tile_size` bytes.
pub(crate) fn tile_count(total: u64, tile_size: u32) -> u64 {
    total.div_ceil(u64::from(tile_size.max(1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_tile_may_be_shorter_than_the_others() {
        let counts = [0, 1, 9, 10, 11, 20].map(|total| tile_count(total, 10));
        assert_eq!(counts, [0, 1, 1, 1, 2, 2]);
        // A malformed tile size does not divide by zero.
        assert_eq!(tile_count(7, 0), 7);
    }
}
