//! How many tiles may be on their way.

use std::time::{Duration, Instant};

/// Most tiles in flight. Three tiles in packets of 1500 bytes take about 330 kB of a receive buffer that is
/// reported as 425984 (asked for: 212992); the rest is for everything else that a participant hears.
pub(crate) const MOST: f64 = 3.0;
/// Losses within so short a time are one event.
const ONE_EVENT: Duration = Duration::from_millis(20);

/// Grows by one tile with each window that arrives, halves with a loss.
#[derive(Debug)]
pub(crate) struct Window {
    tiles: f64,
    shrunk: Option<Instant>,
}

impl Window {
    pub(crate) fn new() -> Window {
        Window { tiles: 2.0, shrunk: None }
    }

    pub(crate) fn tiles(&self) -> usize {
        self.tiles as usize
    }

    pub(crate) fn arrived(&mut self, tiles: usize) {
        self.tiles = (self.tiles + tiles as f64 / self.tiles).min(MOST);
    }

    pub(crate) fn lost(&mut self, now: Instant) {
        if self.shrunk.is_none_or(|at| now.duration_since(at) > ONE_EVENT) {
            self.shrunk = Some(now);
            self.tiles = (self.tiles / 2.0).max(1.0);
        }
    }
}
