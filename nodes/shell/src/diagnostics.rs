//! `/diagnostics`.

use puffer_msgs::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus, KeyValue};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Rates are taken over this time.
const RATE_WINDOW: Duration = Duration::from_secs(5);
/// Events of one key remembered at most.
const EVENTS_KEPT: usize = 10_000;

/// How a node is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Health {
    /// All is well.
    #[default]
    Ok,
    /// Works, but look at it.
    Warn,
    /// Does not work.
    Error,
}

/// What a node tells about itself once a second; clones share it.
#[derive(Clone, Default)]
pub struct Diagnostics {
    board: Arc<Mutex<Board>>,
}

#[derive(Default)]
struct Board {
    health: Health,
    message: String,
    /// In the order of first use.
    entries: Vec<(String, Entry)>,
}

enum Entry {
    Value(String),
    Count(u64),
    Events(VecDeque<Instant>),
}

impl Diagnostics {
    fn board(&self) -> MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets a value; the order of first use is the order shown.
    pub fn set(&self, key: &str, value: impl std::fmt::Display) {
        *self.board().entry(key, || Entry::Value(String::new())) = Entry::Value(value.to_string());
    }

    /// Adds one to a counter.
    pub fn count(&self, key: &str) {
        if let Entry::Count(count) = self.board().entry(key, || Entry::Count(0)) {
            *count += 1;
        }
    }

    /// Notes an event whose rate (Hz, over the last 5 s of wall time) and age (s) are shown.
    pub fn tick(&self, key: &str) {
        if let Entry::Events(events) = self.board().entry(key, || Entry::Events(VecDeque::new())) {
            if events.len() == EVENTS_KEPT {
                events.pop_front();
            }
            events.push_back(Instant::now());
        }
    }

    /// Sets the health and the sentence beside it.
    pub fn health(&self, health: Health, message: &str) {
        let mut board = self.board();
        board.health = health;
        message.clone_into(&mut board.message);
    }

    /// The message for the node of this name, without a stamp.
    pub(crate) fn message(&self, node: &str) -> DiagnosticArray {
        let mut board = self.board();
        let values = board
            .entries
            .iter_mut()
            .flat_map(|(key, entry)| entry.shown(key, Instant::now()))
            .map(|(key, value)| KeyValue { key, value })
            .collect();
        let status = DiagnosticStatus {
            level: match board.health {
                Health::Ok => DiagnosticStatus::OK,
                Health::Warn => DiagnosticStatus::WARN,
                Health::Error => DiagnosticStatus::ERROR,
            },
            name: node.to_owned(),
            message: if board.message.is_empty() {
                "running".to_owned()
            } else {
                board.message.clone()
            },
            values,
            ..Default::default()
        };
        DiagnosticArray { status: vec![status], ..Default::default() }
    }
}

impl Board {
    fn entry(&mut self, key: &str, make: impl FnOnce() -> Entry) -> &mut Entry {
        let at = self.entries.iter().position(|(known, _)| known == key).unwrap_or_else(|| {
            self.entries.push((key.to_owned(), make()));
            self.entries.len() - 1
        });
        &mut self.entries[at].1
    }
}

impl Entry {
    fn shown(&mut self, key: &str, now: Instant) -> Vec<(String, String)> {
        match self {
            Entry::Value(value) => vec![(key.to_owned(), value.clone())],
            Entry::Count(count) => vec![(key.to_owned(), count.to_string())],
            Entry::Events(events) => {
                let age = events.back().map(|last| now.duration_since(*last).as_secs_f64());
                while events.len() > 1 && now.duration_since(events[0]) > RATE_WINDOW {
                    events.pop_front();
                }
                let recent = events.iter().filter(|at| now.duration_since(**at) <= RATE_WINDOW);
                let rate = recent.count() as f64 / RATE_WINDOW.as_secs_f64();
                let age = age.map_or("never".to_owned(), |age| format!("{age:.2}"));
                vec![
                    (format!("{key} rate (Hz)"), format!("{rate:.2}")),
                    (format!("{key} age (s)"), age),
                ]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_counters_and_rates_are_shown_in_order() {
        let diagnostics = Diagnostics::default();
        diagnostics.set("verdict", "good");
        diagnostics.count("scans");
        diagnostics.count("scans");
        for _ in 0..10 {
            diagnostics.tick("tf");
        }
        diagnostics.health(Health::Warn, "slow");
        let message = diagnostics.message("node");
        let status = &message.status[0];
        assert_eq!((status.level, status.message.as_str()), (DiagnosticStatus::WARN, "slow"));
        let shown: Vec<_> =
            status.values.iter().map(|v| (v.key.as_str(), v.value.as_str())).collect();
        assert_eq!(shown[..3], [("verdict", "good"), ("scans", "2"), ("tf rate (Hz)", "2.00")]);
        assert_eq!(shown[3].0, "tf age (s)");
    }
}
