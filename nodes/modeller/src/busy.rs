//! The modeller does one thing at a time.

use std::sync::Arc;
use tokio::sync::watch;

/// Whether the modeller is at work; clones share it. Work is claimed before it starts, so that of
/// two clients that ask at the same time one gets it.
#[derive(Clone)]
pub(crate) struct Busy(Arc<watch::Sender<bool>>);

/// The right to work until it is dropped, also by a panic.
pub(crate) struct Claim(Busy);

impl Default for Busy {
    fn default() -> Busy {
        Busy(Arc::new(watch::Sender::new(false)))
    }
}

impl Busy {
    /// The claim; `None` while another one is held.
    pub(crate) fn claim(&self) -> Option<Claim> {
        let is_new = self.0.send_if_modified(|claimed| !std::mem::replace(claimed, true));
        is_new.then(|| Claim(self.clone()))
    }

    /// Resolves when no claim is held.
    pub(crate) async fn released(&self) {
        // Fails only without a sender, and `self` holds one.
        let _ = self.0.subscribe().wait_for(|claimed| !claimed).await;
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.0.0.send_replace(false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Barrier;
    use std::time::Duration;

    fn claim_at(start: &Barrier, end: &Barrier, busy: &Busy) -> bool {
        start.wait();
        let claim = busy.claim();
        end.wait();
        claim.is_some()
    }

    #[test]
    fn of_those_who_claim_at_once_one_gets_it() {
        let (busy, start, end) = (Busy::default(), Barrier::new(8), Barrier::new(8));
        let winners = std::thread::scope(|scope| {
            let tries: Vec<_> =
                (0..8).map(|_| scope.spawn(|| claim_at(&start, &end, &busy))).collect();
            tries.into_iter().map(|t| t.join().unwrap()).filter(|won| *won).count()
        });
        assert_eq!(winners, 1);
        assert!(busy.claim().is_some());
    }

    #[test]
    fn work_that_panics_gives_its_claim_back() {
        let busy = Busy::default();
        let work = busy.clone();
        let panicked = std::thread::spawn(move || {
            let _claim = work.claim();
            assert!(work.claim().is_some(), "on purpose");
        });
        assert!(panicked.join().is_err());
        assert!(busy.claim().is_some());
    }

    #[tokio::test(start_paused = true)]
    async fn the_end_of_work_is_awaited() {
        let busy = Busy::default();
        busy.released().await;
        let claim = busy.claim();
        let begin = tokio::time::Instant::now();
        tokio::spawn(async move {
            tokio::time::sleep(Duration::from_secs(5)).await;
            drop(claim);
        });
        busy.released().await;
        assert_eq!(begin.elapsed(), Duration::from_secs(5));
    }
}
