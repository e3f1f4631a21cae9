//! The clock of a node: wall time or simulated time.

use crate::Stamp;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::watch;

/// The clock of a node. Clones share it.
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

    /// The time: simulated time (0 until it is set) or that of the system's clock.
    pub fn now(&self) -> Stamp {
        if self.simulated.load(Ordering::Relaxed) { *self.time.borrow() } else { Stamp::wall() }
    }

    /// Switches simulated time on or off.
    pub fn simulate(&self, on: bool) {
        self.simulated.store(on, Ordering::Relaxed);
    }

    pub fn is_simulated(&self) -> bool {
        self.simulated.load(Ordering::Relaxed)
    }

    /// Sets the simulated time.
    pub fn set(&self, time: Stamp) {
        self.time.send_replace(time);
    }

    /// Resolves when the simulated time has reached `stamp`.
    pub async fn reached(&self, stamp: Stamp) {
        // Fails only without a sender, and `self` holds one.
        let _ = self.time.subscribe().wait_for(|time| *time >= stamp).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn simulated_time_starts_at_zero_and_can_be_waited_for() {
        let clock = Clock::new();
        assert!(!clock.is_simulated() && clock.now() > Stamp::new(1_700_000_000, 0));
        clock.simulate(true);
        assert_eq!(clock.now(), Stamp::ZERO);
        let setter = clock.clone();
        let setting = async {
            for second in [1, 2, 3] {
                tokio::task::yield_now().await;
                setter.set(Stamp::new(second, 0));
            }
        };
        tokio::join!(clock.reached(Stamp::new(2, 1)), setting);
        assert_eq!(clock.now(), Stamp::new(3, 0));
        clock.simulate(false);
        assert!(clock.now() > Stamp::new(3, 0));
    }
}
