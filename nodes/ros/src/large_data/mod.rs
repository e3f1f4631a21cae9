//! Large data: clouds and meshes of any size, delivered complete on a host with small socket
//! buffers.
//!
//! A DDS sample that is larger than the receiver's socket buffer does not arrive: its fragments
//! leave in one burst. Here a sample travels as tiles of at most 60 kB on the topic `NAME/tiles`, a
//! few in flight at a time, and each reader acknowledges on `NAME/tiles_ack` which tiles it has.
//! Both topics are best effort: reliable DDS writers keep what a stopped reader has not
//! acknowledged and clean up every 6 s only (rustdds 0.15.1), which would break every bound on
//! memory. Lost tiles show in the acknowledgements and are sent again.
//!
//! `tile_sender` and `tile_receiver` hold the protocol, without DDS, threads or a clock.
//! [`LargeDataPublisher`] and [`LargeDataSubscription`] run it, each in a thread of its own.
//!
//! RViz, rosbag2 and other programs that know nothing of tiles use the topic `NAME` itself, which
//! carries the same messages as ordinary DDS samples: `whole_message_writer` writes and
//! `whole_message_reader` reads them. [`WholeMessagePublisher`] publishes such samples only.

mod congestion_window;
mod large_data_error;
mod outside_endpoints;
mod pending_sample;
mod publisher;
mod reader_state;
mod sample_assembly;
mod sample_queue;
mod socket_buffers;
mod subscription;
#[cfg(test)]
mod tests;
mod tile;
mod tile_receiver;
mod tile_sender;
mod tile_set;
mod tile_topics;
mod whole_message_publisher;
mod whole_message_reader;
mod whole_message_writer;

pub use large_data_error::LargeDataError;
pub use publisher::{LargeDataPublisher, PublisherStats};
pub use sample_queue::Delivery;
pub use socket_buffers::{receive_buffer, receive_buffer_limit};
pub use subscription::{LargeDataSubscription, SubscriptionStats};
pub use tile_sender::Retention;
pub use whole_message_publisher::WholeMessagePublisher;
