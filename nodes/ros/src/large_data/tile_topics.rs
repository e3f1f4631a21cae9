//! The DDS topics that carry the tiles of a large-data topic, and the threads that serve them.

use super::large_data_error::LargeDataError;
use super::tile::{EndpointId, Tile, TileAck};
use puffer_msgs::Interface;
use ros2_client::qos::{History, QosProfile};
use ros2_client::{MessageTypeName, Name, Node, Publisher, Subscription};
use rustdds::Topic;
use std::future::Future;

/// Number of tiles that DDS keeps at a writer and at a reader, each 2 MB: many times what is in
/// flight.
const TILE_HISTORY_DEPTH: usize = 32;
/// Number of acknowledgements that DDS keeps.
const ACK_HISTORY_DEPTH: usize = 256;

/// The topics `NAME/tiles` and `NAME/tiles_ack`.
pub(crate) struct TileTopics {
    topic: String,
    tiles: Topic,
    acks: Topic,
}

impl TileTopics {
    /// The tile topics of `topic`, an absolute ROS name.
    pub(crate) fn new(node: &Node, topic: &str) -> Result<TileTopics, LargeDataError> {
        Ok(TileTopics {
            topic: topic.to_owned(),
            tiles: create_topic(node, topic, "tiles", Tile::NAME, TILE_HISTORY_DEPTH)?,
            acks: create_topic(node, topic, "tiles_ack", TileAck::NAME, ACK_HISTORY_DEPTH)?,
        })
    }

    pub(crate) fn tile_writer(&self, node: &mut Node) -> Result<Publisher<Tile>, LargeDataError> {
        node.create_publisher(&self.tiles, None).map_err(|e| create_error(&self.topic, e))
    }

    pub(crate) fn tile_reader(
        &self,
        node: &mut Node,
    ) -> Result<Subscription<Tile>, LargeDataError> {
        node.create_subscription(&self.tiles, None).map_err(|e| create_error(&self.topic, e))
    }

    pub(crate) fn ack_writer(&self, node: &mut Node) -> Result<Publisher<TileAck>, LargeDataError> {
        node.create_publisher(&self.acks, None).map_err(|e| create_error(&self.topic, e))
    }

    pub(crate) fn ack_reader(
        &self,
        node: &mut Node,
    ) -> Result<Subscription<TileAck>, LargeDataError> {
        node.create_subscription(&self.acks, None).map_err(|e| create_error(&self.topic, e))
    }
}

/// Creates the topic `topic/suffix` of the type `kind` of puffer_msgs. It is best effort: lost
/// samples are sent again by the protocol, and DDS keeps nothing for readers that do not answer.
fn create_topic(
    node: &Node,
    topic: &str,
    suffix: &str,
    kind: &str,
    depth: usize,
) -> Result<Topic, LargeDataError> {
    let name = Name::parse(&format!("{topic}/{suffix}")).map_err(|e| create_error(topic, e))?;
    let kind = MessageTypeName::new(Tile::PACKAGE, kind);
    let qos = QosProfile::subscription_default().history(History::KeepLast { depth });
    node.create_topic(&name, kind, &qos).map_err(|e| create_error(topic, e))
}

/// Runs `work` in a thread of its own: a node that computes on every core does not stop its
/// transport.
pub(crate) fn spawn_thread<F: Future<Output = ()>>(
    topic: &str,
    name: &str,
    work: impl FnOnce() -> F + Send + 'static,
) -> Result<(), LargeDataError> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_time()
        .build()
        .map_err(|e| create_error(topic, e))?;
    std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(move || runtime.block_on(work()))
        .map_err(|e| create_error(topic, e))?;
    Ok(())
}

/// The error of an endpoint of `topic` that could not be made.
pub(crate) fn create_error(topic: &str, error: impl std::fmt::Display) -> LargeDataError {
    LargeDataError::Create { topic: topic.to_owned(), reason: error.to_string() }
}

/// A GUID as hexadecimal digits, for the log.
pub(crate) fn guid_text(id: &EndpointId) -> String {
    id.iter().map(|byte| format!("{byte:02x}")).collect()
}
