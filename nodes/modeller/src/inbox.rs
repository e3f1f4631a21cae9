//! Registered scans as they arrive.

use anyhow::{Result, bail};
use puffer_msgs::msg::RegisteredScan;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The newest version of each scan.
#[derive(Default)]
pub(crate) struct Inbox {
    state: Mutex<Held>,
}

#[derive(Default)]
struct Held {
    scans: BTreeMap<u32, RegisteredScan>,
    /// Numbers whose newest version was not taken yet, in the order of arrival.
    new: Vec<u32>,
}

impl Inbox {
    pub(crate) fn put(&self, scan: RegisteredScan) {
        let mut held = self.lock();
        held.new.retain(|id| *id != scan.id);
        held.new.push(scan.id);
        held.scans.insert(scan.id, scan);
    }

    /// Forgets all.
    pub(crate) fn clear(&self) {
        *self.lock() = Held::default();
    }

    /// Number of scans that came.
    pub(crate) fn len(&self) -> usize {
        self.lock().scans.len()
    }

    /// Waits for scan `id`; a copy of it without its points.
    pub(crate) async fn wait_for(&self, id: u32, deadline: Duration) -> Result<RegisteredScan> {
        let since = Instant::now();
        loop {
            if let Some(scan) = self.lock().scans.get(&id) {
                let cloud = puffer_msgs::sensor_msgs::msg::PointCloud2::default();
                return Ok(RegisteredScan { cloud, ..scan.clone() });
            }
            if since.elapsed() > deadline {
                bail!(
                    "no registered_scan with id {id} within {:.0} s: does scan_registrar run, and does tf reach the \
                     sensor's frame?",
                    deadline.as_secs_f64()
                );
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    /// The scans that are new since the last call.
    pub(crate) fn take_new(&self) -> Vec<RegisteredScan> {
        let mut held = self.lock();
        let new = std::mem::take(&mut held.new);
        let mut taken = Vec::with_capacity(new.len());
        for id in new {
            if let Some(scan) = held.scans.get_mut(&id) {
                // The points are handed on, not kept.
                let cloud = std::mem::take(&mut scan.cloud);
                taken.push(RegisteredScan { cloud, ..scan.clone() });
            }
        }
        taken
    }

    fn lock(&self) -> MutexGuard<'_, Held> {
        // A panic elsewhere does not make the scans wrong.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
