//! Wall time or simulated time.

use crate::Stamp;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::watch;

/// What a node takes for now; clones share it.
#[derive(Clone)]
pub(crate) struct Clock {
    simulated: Arc<AtomicBool>,
    time: Arc<watch::Sender<Stamp>>,
}

impl Clock {
    pub fn new() -> Self {
        Self {
            simulated: Arc::new(AtomicBool::new(false)),
            time: Arc::new(watch::Sender::new(Stamp::ZERO)),
        }
    }

    pub fn now(&self) -> Stamp {
        if self.simulated.load(Ordering::Relaxed) { *self.time.borrow() } else { Stamp::wall() }
    }

    pub fn simulate(&self, on: bool) {
        self.simulated.store(on, Ordering::Relaxed);
    }

    pub fn is_simulated(&self) -> bool {
        self.simulated.load(Ordering::Relaxed)
    }

    pub fn set(&self, time: Stamp) {
        self.time.send_replace(time);
    }

    /// Resolves when simulated time has reached `stamp`.
    pub async fn reached(&self, stamp: Stamp) {
        // Fails only without a sender, and `self` holds one.
        let _ = self.time.subscribe().wait_for(|time| *time >= stamp).await;
    }
}
