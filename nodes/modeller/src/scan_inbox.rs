//! Registered scans as they arrive.

use anyhow::{Result, anyhow};
use puffer_msgs::msg::RegisteredScan;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;

/// The newest version of each scan.
#[derive(Default)]
pub(crate) struct ScanInbox {
    state: Mutex<KeptScans>,
    /// Notified of each scan that is taken.
    arrivals: Notify,
}

#[derive(Default)]
struct KeptScans {
    scans: BTreeMap<u32, RegisteredScan>,
    /// Numbers whose newest version was not taken yet, in the order of arrival.
    new: Vec<u32>,
}

impl ScanInbox {
    /// Takes a scan, or a newer version of one; an older version that comes late is ignored.
    pub(crate) fn put(&self, scan: RegisteredScan) {
        let mut kept = self.lock();
        if kept.scans.get(&scan.id).is_some_and(|known| known.version > scan.version) {
            return;
        }
        kept.new.retain(|id| *id != scan.id);
        kept.new.push(scan.id);
        kept.scans.insert(scan.id, scan);
        drop(kept);
        self.arrivals.notify_waiters();
    }

    /// Forgets all scans.
    pub(crate) fn clear(&self) {
        *self.lock() = KeptScans::default();
    }

    /// Number of scans that came.
    pub(crate) fn len(&self) -> usize {
        self.lock().scans.len()
    }

    /// Waits for scan `id`; returns a copy of it without its points.
    ///
    /// # Errors
    /// It has not come within `deadline`.
    pub(crate) async fn wait_for(&self, id: u32, deadline: Duration) -> Result<RegisteredScan> {
        tokio::time::timeout(deadline, self.arrival(id)).await.map_err(|_| {
            anyhow!(
                "no registered_scan with id {id} within {:.0} s: does scan_registrar run, and does tf reach the \
                 sensor's frame?",
                deadline.as_secs_f64()
            )
        })
    }

    async fn arrival(&self, id: u32) -> RegisteredScan {
        loop {
            // A scan that comes after this line is noticed, also one before the check.
            let arrival = self.arrivals.notified();
            if let Some(scan) = self.lock().scans.get_mut(&id) {
                let cloud = std::mem::take(&mut scan.cloud);
                let bare = scan.clone();
                scan.cloud = cloud;
                return bare;
            }
            arrival.await;
        }
    }

    /// Waits until each of the `wanted` scans (number and version) has come in that version or a
    /// newer one.
    ///
    /// # Errors
    /// Names those that are missing after `deadline`.
    pub(crate) async fn wait_for_versions(
        &self,
        wanted: &[(u32, u32)],
        deadline: Duration,
    ) -> Result<()> {
        let all_came = async {
            loop {
                let arrival = self.arrivals.notified();
                if self.missing(wanted).is_empty() {
                    return;
                }
                arrival.await;
            }
        };
        tokio::time::timeout(deadline, all_came).await.map_err(|_| {
            anyhow!(
                "registered_scan with ids {:?} did not come anew within {:.0} s",
                self.missing(wanted),
                deadline.as_secs_f64()
            )
        })
    }

    fn missing(&self, wanted: &[(u32, u32)]) -> Vec<u32> {
        let kept = self.lock();
        let missing = wanted
            .iter()
            .filter(|(id, version)| kept.scans.get(id).is_none_or(|scan| scan.version < *version));
        missing.map(|(id, _)| *id).collect()
    }

    /// The scans that came since the last call, with their points, which are not kept.
    pub(crate) fn take_new(&self) -> Vec<RegisteredScan> {
        let mut kept = self.lock();
        let new = std::mem::take(&mut kept.new);
        let mut taken = Vec::with_capacity(new.len());
        for id in new {
            if let Some(scan) = kept.scans.get_mut(&id) {
                let cloud = std::mem::take(&mut scan.cloud);
                taken.push(RegisteredScan { cloud, ..scan.clone() });
            }
        }
        taken
    }

    fn lock(&self) -> MutexGuard<'_, KeptScans> {
        // A panic elsewhere does not make the scans wrong.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    /// Puts a version of scan 0.
    fn put(inbox: &ScanInbox, version: u32, status: u8) {
        inbox.put(RegisteredScan { id: 0, version, status, ..RegisteredScan::default() });
    }

    #[tokio::test]
    async fn whoever_waits_hears_of_its_scan_and_a_deadline_names_it() {
        let inbox = Arc::new(ScanInbox::default());
        let waiting = tokio::spawn({
            let inbox = Arc::clone(&inbox);
            async move { inbox.wait_for(1, Duration::from_secs(60)).await }
        });
        tokio::task::yield_now().await;
        for id in [0, 1] {
            inbox.put(RegisteredScan { id, ..RegisteredScan::default() });
        }
        assert_eq!(waiting.await.unwrap().unwrap().id, 1);
        assert_eq!(inbox.wait_for(0, Duration::ZERO).await.unwrap().id, 0);
        let error = inbox.wait_for(2, Duration::from_millis(1)).await.unwrap_err().to_string();
        assert!(error.contains("id 2"), "{error}");
    }

    #[tokio::test]
    async fn an_older_version_that_comes_late_is_passed_over_and_newer_ones_are_awaited() {
        let inbox = Arc::new(ScanInbox::default());
        put(&inbox, 3, RegisteredScan::ACCEPTED);
        assert_eq!(inbox.take_new().len(), 1);
        put(&inbox, 2, RegisteredScan::DEFERRED);
        assert_eq!(inbox.take_new().len(), 0);
        let held = inbox.wait_for(0, Duration::ZERO).await.unwrap();
        assert_eq!((held.version, held.status), (3, RegisteredScan::ACCEPTED));
        inbox.wait_for_versions(&[(0, 3)], Duration::ZERO).await.unwrap();
        let missing = inbox.wait_for_versions(&[(0, 4)], Duration::from_millis(1)).await;
        assert!(missing.unwrap_err().to_string().contains("[0]"));
        let waiting = tokio::spawn({
            let inbox = Arc::clone(&inbox);
            async move { inbox.wait_for_versions(&[(0, 4)], Duration::from_secs(60)).await }
        });
        tokio::task::yield_now().await;
        put(&inbox, 4, RegisteredScan::ACCEPTED);
        waiting.await.unwrap().unwrap();
    }
}
