//! Progress and cancellation of long work.

use crate::{Error, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

type Listener = dyn Fn(&str, f64) + Send + Sync;

/// Handed to every long operation: takes the fraction done, and tells it to stop.
///
/// Clones share the cancel flag and the listener.
#[derive(Clone, Default)]
pub struct Progress {
    cancelled: Arc<AtomicBool>,
    listener: Option<Arc<Listener>>,
}

impl Progress {
    /// Progress that is reported to nobody.
    pub fn silent() -> Self {
        Self::default()
    }

    /// Progress reported to `listener(stage, fraction)`, with the fraction in 0..=1.
    pub fn to(listener: impl Fn(&str, f64) + Send + Sync + 'static) -> Self {
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
}
