//! One thing at a time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether the modeller is at work. It is claimed before the work starts, so that of two who ask at once one gets it.
#[derive(Clone, Default)]
pub(crate) struct Busy(Arc<AtomicBool>);

/// The right to work until it is dropped, also by a panic.
pub(crate) struct Claim(Busy);

impl Busy {
    /// The claim, if nobody else holds it.
    pub(crate) fn claim(&self) -> Option<Claim> {
        let taken = self.0.swap(true, Ordering::SeqCst);
        (!taken).then(|| Claim(self.clone()))
    }

    /// Whether somebody holds the claim.
    pub(crate) fn is_claimed(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.0.0.store(false, Ordering::SeqCst);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Barrier;

    #[test]
    fn of_those_who_claim_at_once_one_gets_it() {
        let (busy, start, end) = (Busy::default(), Barrier::new(8), Barrier::new(8));
        let try_once = || {
            start.wait();
            let claim = busy.claim();
            end.wait();
            claim.is_some()
        };
        let winners = std::thread::scope(|scope| {
            let tries: Vec<_> = (0..8).map(|_| scope.spawn(try_once)).collect();
            tries.into_iter().map(|t| t.join().unwrap()).filter(|won| *won).count()
        });
        assert_eq!(winners, 1);
        assert!(!busy.is_claimed());
    }

    #[test]
    fn work_that_panics_gives_its_claim_back() {
        let busy = Busy::default();
        let work = busy.clone();
        let panicked = std::thread::spawn(move || {
            let _claim = work.claim();
            assert!(!work.is_claimed(), "on purpose");
        });
        assert!(panicked.join().is_err());
        assert!(busy.claim().is_some());
    }
}
