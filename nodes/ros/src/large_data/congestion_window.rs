//! How many tiles may be in flight at once.

use std::time::{Duration, Instant};

/// Upper bound of the window. Three tiles in packets of 1500 bytes take about 330 kB of a receive
/// buffer that Linux reports as 425984 bytes (212992 were asked for); the rest is for everything
/// else that a DDS participant receives.
pub(crate) const MAX_TILES_IN_FLIGHT: f64 = 3.0;
/// Window of a writer that has not sent anything yet, tiles.
const INITIAL_TILES_IN_FLIGHT: f64 = 2.0;
/// The window shrinks at most once within this time, however many tiles a burst loses.
const LOSS_EVENT_DURATION: Duration = Duration::from_millis(20);

/// A window as TCP has it (additive increase, multiplicative decrease): it grows by one tile with
/// each window of tiles that arrives, and halves with a loss.
#[derive(Debug)]
pub(crate) struct CongestionWindow {
    tiles: f64,
    last_shrunk: Option<Instant>,
}

impl CongestionWindow {
    pub(crate) fn new() -> CongestionWindow {
        CongestionWindow { tiles: INITIAL_TILES_IN_FLIGHT, last_shrunk: None }
    }

    /// Number of tiles that may be in flight, at least 1.
    pub(crate) fn tiles(&self) -> usize {
        self.tiles as usize
    }

    /// Takes note that `tiles` tiles have been acknowledged.
    pub(crate) fn on_arrival(&mut self, tiles: usize) {
        self.tiles = (self.tiles + tiles as f64 / self.tiles).min(MAX_TILES_IN_FLIGHT);
    }

    /// Takes note of a loss.
    pub(crate) fn on_loss(&mut self, now: Instant) {
        if self.last_shrunk.is_none_or(|at| now.duration_since(at) > LOSS_EVENT_DURATION) {
            self.last_shrunk = Some(now);
            self.tiles = (self.tiles / 2.0).max(1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrivals_let_the_window_grow_up_to_its_bound() {
        let mut window = CongestionWindow::new();
        assert_eq!(window.tiles(), 2);
        // 2 + 1 / 2 = 2.5, then 2.5 + 1 / 2.5 = 2.9: two arrivals do not make a third tile.
        window.on_arrival(1);
        window.on_arrival(1);
        assert_eq!(window.tiles(), 2);
        window.on_arrival(1);
        assert_eq!(window.tiles(), 3);
        window.on_arrival(1000);
        assert_eq!(window.tiles(), 3);
    }

    #[test]
    fn losses_halve_the_window_once_per_event_and_never_below_one_tile() {
        let start = Instant::now();
        let mut window = CongestionWindow::new();
        window.on_arrival(1000);
        window.on_loss(start);
        assert_eq!(window.tiles(), 1);
        // Still the same event: 1.5 tiles remain, and half a tile more makes two.
        window.on_loss(start + LOSS_EVENT_DURATION);
        window.on_arrival(1);
        assert_eq!(window.tiles(), 2);
        for k in 1..10 {
            window.on_loss(start + 2 * LOSS_EVENT_DURATION * k);
            assert!(window.tiles() >= 1);
        }
    }
}
