//! The samples that have arrived and that the application has not taken yet.

use bytes::Bytes;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;

/// Which samples a subscription hands to its application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// The newest sample; it replaces an older one that was not taken.
    Newest,
    /// Each sample, in order. While two wait, writers hold further ones back.
    Every,
}

/// Number of samples that wait before a reader tells its writers that it is busy.
const MAX_WAITING_SAMPLES: usize = 2;

/// A queue between the thread that receives samples and the application that takes them.
pub(crate) struct SampleQueue {
    delivery: Delivery,
    state: Mutex<QueueState>,
    /// Notified when a sample is added or the queue is closed.
    pub(crate) filled: Notify,
    /// Notified when a sample is taken.
    pub(crate) taken: Notify,
}

struct QueueState {
    samples: VecDeque<Bytes>,
    is_closed: bool,
}

impl SampleQueue {
    pub(crate) fn new(delivery: Delivery) -> SampleQueue {
        let state = Mutex::new(QueueState { samples: VecDeque::new(), is_closed: false });
        SampleQueue { delivery, state, filled: Notify::new(), taken: Notify::new() }
    }

    /// Adds a sample.
    pub(crate) fn push(&self, sample: Bytes) {
        let mut state = self.lock();
        if self.delivery == Delivery::Newest {
            state.samples.clear();
        }
        state.samples.push_back(sample);
        drop(state);
        self.filled.notify_one();
    }

    /// Adds a sample of a writer that cannot be told to hold samples back. Returns whether an older
    /// one had to go for it.
    pub(crate) fn push_evicting_oldest(&self, sample: Bytes) -> bool {
        let is_full = self.is_full();
        if is_full {
            self.lock().samples.pop_front();
        }
        self.push(sample);
        is_full
    }

    /// Whether writers should hold further samples back.
    pub(crate) fn is_full(&self) -> bool {
        self.delivery == Delivery::Every && self.lock().samples.len() >= MAX_WAITING_SAMPLES
    }

    /// The next sample if there is one.
    ///
    /// # Errors
    /// [`QueueClosed`] if there will never be one.
    pub(crate) fn take(&self) -> Result<Option<Bytes>, QueueClosed> {
        let mut state = self.lock();
        match state.samples.pop_front() {
            Some(sample) => {
                self.taken.notify_one();
                Ok(Some(sample))
            }
            None if state.is_closed => Err(QueueClosed),
            None => Ok(None),
        }
    }

    /// Takes note that no sample will be added any more.
    pub(crate) fn close(&self) {
        self.lock().is_closed = true;
        self.filled.notify_one();
    }

    fn lock(&self) -> MutexGuard<'_, QueueState> {
        // A panic elsewhere does not make the queued samples wrong.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The queue is empty and closed.
#[derive(Debug, PartialEq)]
pub(crate) struct QueueClosed;

#[cfg(test)]
mod tests {
    use super::*;

    fn take_all(queue: &SampleQueue) -> Vec<Bytes> {
        std::iter::from_fn(|| queue.take().ok().flatten()).collect()
    }

    #[test]
    fn every_sample_comes_in_order_and_two_make_a_reader_busy() {
        let queue = SampleQueue::new(Delivery::Every);
        for (text, is_full) in [("a", false), ("b", true), ("c", true)] {
            queue.push(text.into());
            assert_eq!(queue.is_full(), is_full);
        }
        assert_eq!(take_all(&queue), ["a", "b", "c"]);
        assert!(!queue.is_full());
    }

    #[test]
    fn the_newest_sample_replaces_the_others() {
        let queue = SampleQueue::new(Delivery::Newest);
        for text in ["a", "b", "c"] {
            queue.push(text.into());
            assert!(!queue.is_full());
        }
        assert_eq!(take_all(&queue), ["c"]);
    }

    #[test]
    fn a_writer_that_cannot_wait_evicts_the_oldest_sample() {
        let queue = SampleQueue::new(Delivery::Every);
        let evicted = ["a", "b", "c"].map(|text| queue.push_evicting_oldest(text.into()));
        assert_eq!(evicted, [false, false, true]);
        assert_eq!(take_all(&queue), ["b", "c"]);
    }

    #[test]
    fn a_closed_queue_still_hands_out_what_it_holds() {
        let queue = SampleQueue::new(Delivery::Every);
        assert_eq!(queue.take(), Ok(None));
        queue.push("a".into());
        queue.close();
        assert_eq!(queue.take(), Ok(Some("a".into())));
        assert_eq!(queue.take(), Err(QueueClosed));
    }
}
