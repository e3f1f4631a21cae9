//! `ros_discovery_info`: which endpoints belong to which node, for `ros2 node info` and its kin.

use super::raw::{Raw, RawAdapter, encode};
use ros2_client::entities_info::{NodeEntitiesInfo, ParticipantEntitiesInfo};
use ros2_client::{Gid, NodeName};
use rustdds::no_key::DataWriter;
use rustdds::{GUID, RepresentationIdentifier, Timestamp};
use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;

/// Endpoints come in bursts; one announcement for all that come within this time.
const QUIET: Duration = Duration::from_millis(20);

pub(crate) struct Graph {
    participant: GUID,
    name: NodeName,
    writer: DataWriter<Raw, RawAdapter>,
    endpoints: Mutex<Endpoints>,
    changed: Notify,
}

#[derive(Default)]
struct Endpoints {
    readers: BTreeSet<Gid>,
    writers: BTreeSet<Gid>,
    /// What another library announces for the same participant.
    foreign: Option<ros2_client::Context>,
}

impl Graph {
    pub fn new(participant: GUID, name: NodeName, writer: DataWriter<Raw, RawAdapter>) -> Self {
        Self { participant, name, writer, endpoints: Mutex::default(), changed: Notify::new() }
    }

    fn change(&self, change: impl FnOnce(&mut Endpoints)) {
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

    pub fn add_foreign(&self, context: ros2_client::Context) {
        self.change(|e| e.foreign = Some(context));
    }

    /// Announces again, for what has changed elsewhere.
    pub fn refresh(&self) {
        self.changed.notify_one();
    }

    /// Announces changes, for ever.
    pub async fn run(&self) {
        loop {
            self.changed.notified().await;
            tokio::time::sleep(QUIET).await;
            self.announce();
        }
    }

    fn announce(&self) {
        let info = {
            let endpoints = self.endpoints.lock().unwrap_or_else(PoisonError::into_inner);
            let foreign = endpoints
                .foreign
                .as_ref()
                .and_then(|context| context.participant_entities_info().nodes().first().cloned());
            let mut node = foreign.unwrap_or_else(|| NodeEntitiesInfo::new(self.name.clone()));
            endpoints.readers.iter().for_each(|gid| node.add_reader(*gid));
            endpoints.writers.iter().for_each(|gid| node.add_writer(*gid));
            ParticipantEntitiesInfo::new(Gid::from(self.participant), vec![node])
        };
        // Only tools read it: a failure here must not stop a node.
        if let Ok(body) = encode(&info) {
            let raw = Raw { body: body.into(), encoding: RepresentationIdentifier::CDR_LE };
            let _ = self.writer.write(raw, Some(Timestamp::now()));
        }
    }
}
