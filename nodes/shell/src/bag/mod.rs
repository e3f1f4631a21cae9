//! Bags: ROS 2 messages in MCAP files (<https://mcap.dev>), as `rosbag2_storage_mcap` writes and reads them.
//!
//! Messages stay bytes (CDR with its encapsulation header), so that any type can be recorded and played. A recording that
//! was cut off can be read up to the last whole chunk.

mod block;
mod error;
mod folder;
mod index;
mod info;
mod messages;
mod play;
mod qos;
mod reader;
mod record;
mod recorder;
mod rosbag2;
mod route;
mod scan;
mod summary;
#[cfg(test)]
mod tests;
mod writer;

pub use error::BagError;
pub use info::{BagInfo, BagMessage, BagTopic};
pub use messages::Messages;
pub use play::Player;
pub use reader::BagReader;
pub use record::record;
pub use recorder::Recording;
pub use route::{Route, TopicRoute};
pub use writer::BagWriter;
