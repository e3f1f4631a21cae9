//! Which remote endpoints are matched with those of a participant.

use rustdds::{DomainParticipantStatusEvent, GUID};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, PoisonError};
use tokio::sync::watch;

/// The matched remote endpoints of each local one.
pub(crate) struct MatchedEndpoints {
    pairs: Mutex<BTreeMap<GUID, BTreeSet<GUID>>>,
    changed: watch::Sender<u64>,
}

impl MatchedEndpoints {
    pub fn new() -> Self {
        Self { pairs: Mutex::default(), changed: watch::Sender::new(0) }
    }

    /// The remote endpoints that are matched with `local`.
    pub fn remotes_of(&self, local: GUID) -> BTreeSet<GUID> {
        let pairs = self.pairs.lock().unwrap_or_else(PoisonError::into_inner);
        pairs.get(&local).cloned().unwrap_or_default()
    }

    /// Number of remote endpoints that are matched with `local`.
    pub fn count(&self, local: GUID) -> usize {
        let pairs = self.pairs.lock().unwrap_or_else(PoisonError::into_inner);
        pairs.get(&local).map_or(0, BTreeSet::len)
    }

    /// Resolves when `holds` returns true; it is called at once and again after each change.
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

    /// Takes note of what discovery has found.
    pub fn on_status_event(&self, event: &DomainParticipantStatusEvent) {
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

    /// Takes note that the endpoint `local` is gone.
    pub fn remove_local(&self, local: GUID) {
        self.pairs.lock().unwrap_or_else(PoisonError::into_inner).remove(&local);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOCAL: [u8; 16] = [1; 16];

    /// A GUID of participant `participant`; the first twelve bytes are the participant's.
    fn guid(participant: u8, entity: u8) -> GUID {
        let mut bytes = [participant; 16];
        bytes[12..].fill(entity);
        GUID::from_bytes(bytes)
    }

    fn match_reader(matches: &MatchedEndpoints, remote_reader: GUID) {
        matches.on_status_event(&DomainParticipantStatusEvent::RemoteReaderMatched {
            local_writer: GUID::from_bytes(LOCAL),
            remote_reader,
        });
    }

    #[test]
    fn matches_are_counted_until_the_local_endpoint_goes() {
        let matches = MatchedEndpoints::new();
        let local = GUID::from_bytes(LOCAL);
        assert_eq!(matches.count(local), 0);
        for remote in [guid(2, 1), guid(2, 2), guid(3, 1), guid(2, 1)] {
            match_reader(&matches, remote);
        }
        assert_eq!(matches.count(local), 3);
        assert!(matches.remotes_of(local).contains(&guid(3, 1)));
        assert_eq!(matches.count(guid(9, 9)), 0);
        matches.remove_local(local);
        assert_eq!(matches.count(local), 0);
    }

    #[tokio::test]
    async fn a_wait_ends_with_the_match_that_it_waits_for() {
        let matches = MatchedEndpoints::new();
        let local = GUID::from_bytes(LOCAL);
        let mut probes = 0;
        let waiting = matches.wait(|matches| {
            probes += 1;
            matches.count(local) == 2
        });
        let matching = async {
            for remote in [guid(2, 1), guid(3, 1)] {
                tokio::task::yield_now().await;
                match_reader(&matches, remote);
            }
        };
        tokio::join!(waiting, matching);
        assert!(probes >= 2, "{probes}");
    }
}
