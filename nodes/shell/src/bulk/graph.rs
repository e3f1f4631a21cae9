//! Who else uses a topic: endpoints of other participants that know nothing of tiles.

use rustdds::policy::{Durability, Reliability};
use rustdds::{DomainParticipant, GUID, QosPolicies, QosPolicyBuilder, RTPSEntity};

/// DDS name of the topic with the ROS name `topic`.
pub(crate) fn dds_name(topic: &str) -> String {
    format!("rt{topic}")
}

fn tiles_name(topic: &str) -> String {
    format!("rt{topic}/tiles")
}

/// Readers of whole messages on `topic`.
pub(crate) fn outside_readers(participant: &DomainParticipant, topic: &str) -> usize {
    let (name, tiles) = (dds_name(topic), tiles_name(topic));
    let readers = participant.discovered_readers();
    let with_tiles: Vec<_> = readers
        .iter()
        .filter(|r| *r.subscription_topic_data.topic_name() == tiles)
        .map(|r| r.reader_proxy.remote_reader_guid.prefix)
        .collect();
    readers
        .iter()
        .filter(|r| *r.subscription_topic_data.topic_name() == name)
        .map(|r| r.reader_proxy.remote_reader_guid.prefix)
        .filter(|prefix| *prefix != participant.guid().prefix && !with_tiles.contains(prefix))
        .count()
}

/// What a writer of whole messages on `topic` offers, if there is one: the quality to ask for.
pub(crate) fn outside_writer(participant: &DomainParticipant, topic: &str) -> Option<QosPolicies> {
    let (name, tiles) = (dds_name(topic), tiles_name(topic));
    let writers = participant.discovered_writers();
    let prefix = |guid: GUID| guid.prefix;
    let with_tiles: Vec<_> = writers
        .iter()
        .filter(|w| w.publication_topic_data.topic_name == tiles)
        .map(|w| prefix(w.writer_proxy.remote_writer_guid))
        .collect();
    let writer = writers.iter().find(|w| {
        let from = prefix(w.writer_proxy.remote_writer_guid);
        w.publication_topic_data.topic_name == name
            && from != participant.guid().prefix
            && !with_tiles.contains(&from)
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
    let tiles = tiles_name(topic);
    participant.discovered_writers().iter().any(|w| {
        w.publication_topic_data.topic_name == tiles
            && w.writer_proxy.remote_writer_guid.prefix == writer.prefix
    })
}
