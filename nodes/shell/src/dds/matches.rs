//! Which remote endpoints our own are matched with.

use rustdds::{DomainParticipantStatusEvent, GUID};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, PoisonError};
use tokio::sync::watch;

/// Matched remote endpoints for each local one.
pub(crate) struct Matches {
    pairs: Mutex<BTreeMap<GUID, BTreeSet<GUID>>>,
    changed: watch::Sender<u64>,
}

impl Matches {
    pub fn new() -> Self {
        Self { pairs: Mutex::default(), changed: watch::Sender::new(0) }
    }

    pub fn of(&self, local: GUID) -> BTreeSet<GUID> {
        let pairs = self.pairs.lock().unwrap_or_else(PoisonError::into_inner);
        pairs.get(&local).cloned().unwrap_or_default()
    }

    pub fn count(&self, local: GUID) -> usize {
        let pairs = self.pairs.lock().unwrap_or_else(PoisonError::into_inner);
        pairs.get(&local).map_or(0, BTreeSet::len)
    }

    /// Resolves when `holds` does; it is asked again after every change.
    pub async fn wait(&self, mut holds: impl FnMut(&Self) -> bool) {
        let mut changes = self.changed.subscribe();
        loop {
            changes.borrow_and_update();
            if holds(self) {
                return;
            }
            // Fails only without a sender, and `self` holds one.
            let _ = changes.changed().await;
        }
    }

    pub fn note(&self, event: &DomainParticipantStatusEvent) {
        use DomainParticipantStatusEvent as Event;
        {
            let mut pairs = self.pairs.lock().unwrap_or_else(PoisonError::into_inner);
            match event {
                Event::RemoteReaderMatched { local_writer: local, remote_reader: remote }
                | Event::RemoteWriterMatched { local_reader: local, remote_writer: remote } => {
                    pairs.entry(*local).or_default().insert(*remote);
                }
                Event::ReaderLost { guid, .. } | Event::WriterLost { guid, .. } => {
                    for remotes in pairs.values_mut() {
                        remotes.remove(guid);
                    }
                }
                Event::ParticipantLost { id, .. } => {
                    for remotes in pairs.values_mut() {
                        remotes.retain(|guid| guid.prefix != *id);
                    }
                }
                _ => return,
            }
        }
        self.changed.send_modify(|count| *count += 1);
    }

    pub fn forget(&self, local: GUID) {
        self.pairs.lock().unwrap_or_else(PoisonError::into_inner).remove(&local);
    }
}
