//! What a node tells of itself on `/diagnostics`.

use puffer_msgs::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus, KeyValue};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Rates are averages over this time.
const RATE_WINDOW: Duration = Duration::from_secs(5);
/// Largest number of events that are remembered for a key.
const MAX_EVENTS: usize = 10_000;

/// The health of a node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Health {
    /// The node works.
    #[default]
    Ok,
    /// The node works, but somebody should look at it.
    Warn,
    /// The node does not work.
    Error,
}

/// What a node tells of itself on `/diagnostics` once a second: health and named values. Clones
/// share it. [`Node::diagnostics`](crate::Node::diagnostics) returns it.
///
/// ```
/// # use puffer_ros::{Diagnostics, Health};
/// let diagnostics = Diagnostics::default();
/// diagnostics.set("verdict", "good");
/// diagnostics.count("scans");
/// diagnostics.tick("joint states");
/// diagnostics.health(Health::Warn, "the robot is slow");
/// ```
#[derive(Clone, Default)]
pub struct Diagnostics {
    state: Arc<Mutex<DiagnosticState>>,
}

/// The health and the values of a node.
#[derive(Default)]
struct DiagnosticState {
    health: Health,
    message: String,
    /// In the order of first use.
    entries: Vec<(String, DiagnosticEntry)>,
}

/// A value, or what one is computed from.
enum DiagnosticEntry {
    Value(String),
    Count(u64),
    Events(VecDeque<Instant>),
}

impl Diagnostics {
    fn state(&self) -> MutexGuard<'_, DiagnosticState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets a value; values are shown in the order of their first use.
    pub fn set(&self, key: &str, value: impl std::fmt::Display) {
        *self.state().entry(key, || DiagnosticEntry::Value(String::new())) =
            DiagnosticEntry::Value(value.to_string());
    }

    /// Adds one to a counter.
    pub fn count(&self, key: &str) {
        if let DiagnosticEntry::Count(count) = self.state().entry(key, || DiagnosticEntry::Count(0))
        {
            *count += 1;
        }
    }

    /// Notes an event; the rate of the events (Hz, over the last 5 s of wall time) and the age of
    /// the last one (s) are shown.
    pub fn tick(&self, key: &str) {
        if let DiagnosticEntry::Events(events) =
            self.state().entry(key, || DiagnosticEntry::Events(VecDeque::new()))
        {
            if events.len() == MAX_EVENTS {
                events.pop_front();
            }
            events.push_back(Instant::now());
        }
    }

    /// Sets the health and the sentence that explains it.
    pub fn health(&self, health: Health, message: &str) {
        let mut state = self.state();
        state.health = health;
        message.clone_into(&mut state.message);
    }

    /// The message of the node with this name, without a stamp.
    pub(crate) fn message(&self, node: &str) -> DiagnosticArray {
        let mut state = self.state();
        let values = state
            .entries
            .iter_mut()
            .flat_map(|(key, entry)| entry.key_values(key, Instant::now()))
            .map(|(key, value)| KeyValue { key, value })
            .collect();
        let status = DiagnosticStatus {
            level: match state.health {
                Health::Ok => DiagnosticStatus::OK,
                Health::Warn => DiagnosticStatus::WARN,
                Health::Error => DiagnosticStatus::ERROR,
            },
            name: node.to_owned(),
            message: if state.message.is_empty() {
                "running".to_owned()
            } else {
                state.message.clone()
            },
            values,
            ..Default::default()
        };
        DiagnosticArray { status: vec![status], ..Default::default() }
    }
}

impl DiagnosticState {
    fn entry(&mut self, key: &str, make: impl FnOnce() -> DiagnosticEntry) -> &mut DiagnosticEntry {
        let at = self.entries.iter().position(|(known, _)| known == key).unwrap_or_else(|| {
            self.entries.push((key.to_owned(), make()));
            self.entries.len() - 1
        });
        &mut self.entries[at].1
    }
}

impl DiagnosticEntry {
    /// The keys and values to show.
    fn key_values(&mut self, key: &str, now: Instant) -> Vec<(String, String)> {
        match self {
            DiagnosticEntry::Value(value) => vec![(key.to_owned(), value.clone())],
            DiagnosticEntry::Count(count) => vec![(key.to_owned(), count.to_string())],
            DiagnosticEntry::Events(events) => {
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

    #[test]
    fn a_rate_counts_the_events_of_the_window_and_an_age_those_before_it() {
        let now = Instant::now();
        let ages = [10.0, 6.0, 4.0, 2.0, 1.0];
        let events = ages.map(|age| now.checked_sub(Duration::from_secs_f64(age)).unwrap());
        let shown = DiagnosticEntry::Events(VecDeque::from(events)).key_values("scan", now);
        assert_eq!(shown[0], ("scan rate (Hz)".to_owned(), "0.60".to_owned()));
        assert_eq!(shown[1], ("scan age (s)".to_owned(), "1.00".to_owned()));
        let old = VecDeque::from([events[0]]);
        let shown = DiagnosticEntry::Events(old).key_values("scan", now);
        assert_eq!((&*shown[0].1, &*shown[1].1), ("0.00", "10.00"));
        let none = DiagnosticEntry::Events(VecDeque::new()).key_values("scan", now);
        assert_eq!((&*none[0].1, &*none[1].1), ("0.00", "never"));
    }

    #[test]
    fn a_silent_node_runs_and_a_value_is_replaced_in_place() {
        let diagnostics = Diagnostics::default();
        let status = diagnostics.message("/node").status.remove(0);
        assert_eq!((status.level, &*status.message), (DiagnosticStatus::OK, "running"));
        diagnostics.set("a", 1);
        diagnostics.set("b", 2);
        diagnostics.set("a", 3);
        diagnostics.health(Health::Error, "");
        let status = diagnostics.message("/node").status.remove(0);
        let values: Vec<_> = status.values.iter().map(|v| (&*v.key, &*v.value)).collect();
        assert_eq!(values, [("a", "3"), ("b", "2")]);
        assert_eq!(status.level, DiagnosticStatus::ERROR);
    }
}
