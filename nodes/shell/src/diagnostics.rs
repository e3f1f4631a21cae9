//! `/diagnostics`.

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
pub struct Diagnostics {}

impl Diagnostics {
    /// Sets a value; the order of first use is the order shown.
    pub fn set(&self, key: &str, value: impl std::fmt::Display) {
        let _ = (key, value.to_string());
    }

    /// Adds one to a counter.
    pub fn count(&self, key: &str) {
        let _ = key;
    }

    /// Notes an event whose rate (Hz, over the last seconds of wall time) and age are shown.
    pub fn tick(&self, key: &str) {
        let _ = key;
    }

    /// Sets the health and the sentence beside it.
    pub fn health(&self, health: Health, message: &str) {
        let _ = (health, message);
    }
}
