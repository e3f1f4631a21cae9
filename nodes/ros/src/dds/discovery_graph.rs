//! The topic `ros_discovery_info`, which says which endpoints belong to which node: `ros2 node
//! info` and the like read it.

use super::serialized_payload::{PayloadAdapter, SerializedPayload, encode};
use ros2_client::entities_info::{NodeEntitiesInfo, ParticipantEntitiesInfo};
use ros2_client::{Gid, NodeName};
use rustdds::no_key::DataWriter;
use rustdds::{GUID, RepresentationIdentifier, Timestamp};
use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;

/// Endpoints are made in bursts; one announcement covers all that are made within this time.
const ANNOUNCE_DELAY: Duration = Duration::from_millis(20);

/// Announces the endpoints of one node.
pub(crate) struct DiscoveryGraph {
    participant: GUID,
    name: NodeName,
    writer: DataWriter<SerializedPayload, PayloadAdapter>,
    endpoints: Mutex<AnnouncedEndpoints>,
    changed: Notify,
}

#[derive(Default)]
struct AnnouncedEndpoints {
    readers: BTreeSet<Gid>,
    writers: BTreeSet<Gid>,
    /// The context of ros2-client on the same participant, which knows the endpoints made there.
    ros2_context: Option<ros2_client::Context>,
}

impl DiscoveryGraph {
    pub fn new(
        participant: GUID,
        name: NodeName,
        writer: DataWriter<SerializedPayload, PayloadAdapter>,
    ) -> Self {
        Self { participant, name, writer, endpoints: Mutex::default(), changed: Notify::new() }
    }

    fn change(&self, change: impl FnOnce(&mut AnnouncedEndpoints)) {
        change(&mut self.endpoints.lock().unwrap_or_else(PoisonError::into_inner));
        self.changed.notify_one();
    }

    pub fn add_reader(&self, guid: GUID) {
        self.change(|e| e.readers.extend([Gid::from(guid)]));
    }

    pub fn add_writer(&self, guid: GUID) {
        self.change(|e| e.writers.extend([Gid::from(guid)]));
    }

    pub fn remove(&self, guid: GUID) {
        self.change(|e| {
            e.readers.remove(&Gid::from(guid));
            e.writers.remove(&Gid::from(guid));
        });
    }

    pub fn set_ros2_context(&self, context: ros2_client::Context) {
        self.change(|e| e.ros2_context = Some(context));
    }

    /// Announces again, for endpoints that were made through ros2-client.
    pub fn refresh(&self) {
        self.changed.notify_one();
    }

    /// Announces changes; never returns.
    pub async fn run(&self) {
        loop {
            self.changed.notified().await;
            tokio::time::sleep(ANNOUNCE_DELAY).await;
            self.announce();
        }
    }

    fn announce(&self) {
        let info = {
            let endpoints = self.endpoints.lock().unwrap_or_else(PoisonError::into_inner);
            let ros2_node = endpoints
                .ros2_context
                .as_ref()
                .and_then(|context| context.participant_entities_info().nodes().first().cloned());
            let mut node = ros2_node.unwrap_or_else(|| NodeEntitiesInfo::new(self.name.clone()));
            endpoints.readers.iter().for_each(|gid| node.add_reader(*gid));
            endpoints.writers.iter().for_each(|gid| node.add_writer(*gid));
            ParticipantEntitiesInfo::new(Gid::from(self.participant), vec![node])
        };
        // Only tools read it: a failure here must not stop a node.
        if let Ok(body) = encode(&info) {
            let payload =
                SerializedPayload { body: body.into(), encoding: RepresentationIdentifier::CDR_LE };
            let _ = self.writer.write(payload, Some(Timestamp::now()));
        }
    }
}
