//! Bulk transport: clouds and meshes of any size, complete on a host with small socket buffers.
//!
//! A sample larger than the receiver's socket buffer does not survive as one DDS sample: its fragments leave in one
//! burst. Here it travels as tiles of at most 60 kB on `NAME/tiles`, a few in flight at a time, and each reader says
//! on `NAME/tiles_ack` what it has. Both topics are best effort: reliable DDS writers keep what a stopped reader has
//! not acknowledged and clean up every 6 s only, which would break every bound on memory. What is lost is seen from
//! the acknowledgements and sent again.
//!
//! `sender` and `receiver` are the protocol, without DDS, threads or clock; [`BulkPublisher`] and [`BulkSubscription`]
//! run them, each in a thread of its own. Outsiders use the named topic: `whole` writes it, `plain` reads it.
//! [`WholePublisher`] writes only that.

mod assembly;
mod bits;
mod error;
mod graph;
mod held;
mod host;
mod inbox;
mod member;
mod plain;
mod publisher;
mod receiver;
mod sender;
mod subscription;
#[cfg(test)]
mod tests;
mod topic;
mod watchers;
mod whole;
mod window;
mod wire;

pub use error::BulkError;
pub use host::{receive_buffer, receive_buffer_limit};
pub use inbox::Delivery;
pub use publisher::{BulkPublisher, PublisherStats};
pub use sender::Mode;
pub use subscription::{BulkSubscription, SubscriptionStats};
pub use watchers::WholePublisher;
