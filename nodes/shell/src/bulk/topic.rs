//! The DDS endpoints of a bulk topic, and the threads that serve them.

use super::error::BulkError;
use super::wire::{Id, Tile, TileAck};
use puffer_msgs::Interface;
use ros2_client::qos::{History, QosProfile};
use ros2_client::{MessageTypeName, Name, Node, Publisher, Subscription};
use rustdds::Topic;
use std::future::Future;

/// Tiles that DDS keeps at a writer and at a reader, each: many times what is in flight, 2 MB.
const TILES_KEPT: usize = 32;
/// Acknowledgements that DDS keeps.
const ACKS_KEPT: usize = 256;

/// The two topics.
pub(crate) struct Endpoints {
    topic: String,
    tiles: Topic,
    acks: Topic,
}

impl Endpoints {
    pub(crate) fn new(node: &Node, topic: &str) -> Result<Endpoints, BulkError> {
        let make = |suffix: &str, kind: &str, kept: usize| {
            let name = Name::parse(&format!("{topic}/{suffix}")).map_err(|e| refused(topic, e))?;
            let kind = MessageTypeName::new(Tile::PACKAGE, kind);
            node.create_topic(&name, kind, &quality(kept)).map_err(|e| refused(topic, e))
        };
        Ok(Endpoints {
            topic: topic.to_owned(),
            tiles: make("tiles", Tile::NAME, TILES_KEPT)?,
            acks: make("tiles_ack", TileAck::NAME, ACKS_KEPT)?,
        })
    }

    pub(crate) fn tiles_writer(&self, node: &mut Node) -> Result<Publisher<Tile>, BulkError> {
        node.create_publisher(&self.tiles, None).map_err(|e| refused(&self.topic, e))
    }

    pub(crate) fn tiles_reader(&self, node: &mut Node) -> Result<Subscription<Tile>, BulkError> {
        node.create_subscription(&self.tiles, None).map_err(|e| refused(&self.topic, e))
    }

    pub(crate) fn acks_writer(&self, node: &mut Node) -> Result<Publisher<TileAck>, BulkError> {
        node.create_publisher(&self.acks, None).map_err(|e| refused(&self.topic, e))
    }

    pub(crate) fn acks_reader(&self, node: &mut Node) -> Result<Subscription<TileAck>, BulkError> {
        node.create_subscription(&self.acks, None).map_err(|e| refused(&self.topic, e))
    }
}

/// Runs `work` in a thread of its own: a node that computes on every core does not stop its transport.
pub(crate) fn start<F: Future<Output = ()>>(
    topic: &str,
    name: &str,
    work: impl FnOnce() -> F + Send + 'static,
) -> Result<(), BulkError> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_time()
        .build()
        .map_err(|e| refused(topic, e))?;
    std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(move || runtime.block_on(work()))
        .map_err(|e| refused(topic, e))?;
    Ok(())
}

/// Best effort: what is lost is sent again by ourselves, and DDS keeps nothing for readers that do not answer.
fn quality(kept: usize) -> QosProfile {
    QosProfile::subscription_default().history(History::KeepLast { depth: kept })
}

pub(crate) fn refused(topic: &str, error: impl std::fmt::Display) -> BulkError {
    BulkError::Create { topic: topic.to_owned(), reason: error.to_string() }
}

/// A GUID for people.
pub(crate) fn name_of(id: &Id) -> String {
    id.iter().map(|byte| format!("{byte:02x}")).collect()
}
