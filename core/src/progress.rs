//! Progress and cancellation of long work.
//!
//! ```
//! use puffer_core::{Error, Progress};
//!
//! let progress = Progress::silent();
//! progress.report("filter", 0.5)?;
//! progress.cancel();
//! assert!(matches!(progress.report("filter", 0.6), Err(Error::Cancelled)));
//! # Ok::<(), puffer_core::Error>(())
//! ```

use crate::{Error, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

type Listener = dyn Fn(&str, f64) + Send + Sync;

/// Progress and cancel flag of a long operation: the operation reports the fraction that is done,
/// and learns from the report whether it must stop.
///
/// Clones share the cancel flag and the listener.
#[derive(Clone, Default)]
pub struct Progress {
    cancelled: Arc<AtomicBool>,
    listener: Option<Arc<Listener>>,
}

impl Progress {
    /// Progress without a listener.
    pub fn silent() -> Self {
        Self::default()
    }

    /// Progress reported to `listener(stage, fraction)`, with the fraction in 0..=1.
    pub fn with_listener(listener: impl Fn(&str, f64) + Send + Sync + 'static) -> Self {
        Self { cancelled: Arc::default(), listener: Some(Arc::new(listener)) }
    }

    /// Asks the work to stop at its next report.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Reports that `stage` is done to `fraction` (0..=1).
    ///
    /// # Errors
    /// [`Error::Cancelled`] once [`Progress::cancel`] was called.
    pub fn report(&self, stage: &str, fraction: f64) -> Result<()> {
        if self.cancelled.load(Ordering::Relaxed) {
            return Err(Error::Cancelled);
        }
        if let Some(listener) = &self.listener {
            listener(stage, fraction.clamp(0.0, 1.0));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cancelled_progress_stops_every_clone() {
        let progress = Progress::silent();
        let clone = progress.clone();
        assert!(clone.report("stage", 0.5).is_ok());
        progress.cancel();
        assert!(matches!(clone.report("stage", 0.6), Err(Error::Cancelled)));
    }

    #[test]
    fn the_listener_gets_stages_and_fractions_within_their_bounds() {
        let (sender, receiver) = std::sync::mpsc::channel();
        let progress = Progress::with_listener(move |stage, fraction| {
            let _ = sender.send((stage.to_owned(), fraction));
        });
        for fraction in [-0.5, 0.25, 1.5] {
            progress.report("stage", fraction).unwrap();
        }
        let reports: Vec<(String, f64)> = receiver.try_iter().collect();
        assert_eq!(reports.iter().map(|r| r.1).collect::<Vec<_>>(), [0.0, 0.25, 1.0]);
        assert!(reports.iter().all(|r| r.0 == "stage"));
    }
}
