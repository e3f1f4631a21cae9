//! Bags: ROS 2 messages in MCAP files (<https://mcap.dev>), as `rosbag2_storage_mcap` writes and
//! reads them.
//!
//! Messages stay bytes (CDR with its encapsulation header), so that any type can be recorded and
//! played. A recording that was cut off can be read up to the last whole chunk.
//!
//! ```
//! use puffer_msgs::rosgraph_msgs::msg::Clock;
//! use puffer_msgs::{Interface, cdr};
//! use puffer_ros::Stamp;
//! use puffer_ros::bag::{BagReader, BagWriter};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("run.mcap");
//! let mut bag = BagWriter::create(&path)?;
//! for second in [1, 2, 3] {
//!     let stamp = Stamp::new(second, 0);
//!     let bytes = cdr::to_bytes(&Clock { clock: stamp.into() })?;
//!     bag.write("/clock", Clock::TYPE_NAME, &bytes, stamp, stamp)?;
//! }
//! bag.finish()?;
//!
//! let bag = BagReader::open(&path)?;
//! assert_eq!(bag.info().count, 3);
//! let last = bag.messages(&["/clock"])?.last().unwrap()?;
//! assert_eq!(last.log_time, Stamp::from_seconds(3.0));
//! assert_eq!(last.decode::<Clock>()?.clock.sec, 3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bag_error;
mod bag_folder;
mod bag_info;
mod block_reader;
mod file_index;
mod index_recovery;
mod index_summary;
mod message_iterator;
mod offered_qos;
mod player;
mod reader;
mod recording;
mod rosbag2_metadata;
#[cfg(test)]
mod tests;
mod topic_receiver;
mod topic_route;
mod writer;

pub use bag_error::BagError;
pub use bag_info::{BagInfo, BagMessage, BagTopic};
pub use message_iterator::Messages;
pub use player::Player;
pub use reader::BagReader;
pub use recording::Recording;
pub use topic_receiver::receive_topics;
pub use topic_route::{Route, TopicRoute};
pub use writer::BagWriter;
