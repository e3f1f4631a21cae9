//! The endpoints of other participants that know nothing of tiles, as DDS discovery shows them.

use crate::dds::ros_topic;
use rustdds::policy::{Durability, Reliability};
use rustdds::{DomainParticipant, GUID, QosPolicies, QosPolicyBuilder, RTPSEntity};

fn tiles_topic(topic: &str) -> String {
    format!("{}/tiles", ros_topic(topic))
}

/// Number of readers of whole messages on `topic` whose participants do not read tiles.
pub(crate) fn count_outside_readers(participant: &DomainParticipant, topic: &str) -> usize {
    let (name, tiles) = (ros_topic(topic), tiles_topic(topic));
    let readers = participant.discovered_readers();
    let tile_participants: Vec<_> = readers
        .iter()
        .filter(|r| *r.subscription_topic_data.topic_name() == tiles)
        .map(|r| r.reader_proxy.remote_reader_guid.prefix)
        .collect();
    readers
        .iter()
        .filter(|r| *r.subscription_topic_data.topic_name() == name)
        .map(|r| r.reader_proxy.remote_reader_guid.prefix)
        .filter(|p| *p != participant.guid().prefix && !tile_participants.contains(p))
        .count()
}

/// The reliability and durability that a writer of whole messages on `topic` offers, whose
/// participant does not write tiles: the QoS to request. `None` if there is no such writer.
pub(crate) fn outside_writer_qos(
    participant: &DomainParticipant,
    topic: &str,
) -> Option<QosPolicies> {
    let (name, tiles) = (ros_topic(topic), tiles_topic(topic));
    let writers = participant.discovered_writers();
    let tile_participants: Vec<_> = writers
        .iter()
        .filter(|w| w.publication_topic_data.topic_name == tiles)
        .map(|w| w.writer_proxy.remote_writer_guid.prefix)
        .collect();
    let writer = writers.iter().find(|w| {
        let prefix = w.writer_proxy.remote_writer_guid.prefix;
        w.publication_topic_data.topic_name == name
            && prefix != participant.guid().prefix
            && !tile_participants.contains(&prefix)
    })?;
    let data = &writer.publication_topic_data;
    Some(
        QosPolicyBuilder::new()
            .reliability(data.reliability.unwrap_or(Reliability::BestEffort))
            .durability(data.durability.unwrap_or(Durability::Volatile))
            .build(),
    )
}

/// Whether the participant of `writer` also writes tiles on `topic`.
pub(crate) fn writes_tiles(participant: &DomainParticipant, topic: &str, writer: GUID) -> bool {
    let tiles = tiles_topic(topic);
    participant.discovered_writers().iter().any(|w| {
        w.publication_topic_data.topic_name == tiles
            && w.writer_proxy.remote_writer_guid.prefix == writer.prefix
    })
}
