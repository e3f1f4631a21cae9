//! Samples that have arrived and that the application has not taken.

use bytes::Bytes;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;

/// What a subscription hands to its application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// The newest sample; an older one that was not taken is replaced.
    Newest,
    /// Each sample. While two wait, writers are told to hold further ones back.
    Every,
}

/// Samples that wait before a reader is busy.
const WAITING: usize = 2;

/// A place where a thread puts samples and the application takes them.
pub(crate) struct Inbox {
    delivery: Delivery,
    state: Mutex<State>,
    /// Something was put in, or it was closed.
    pub(crate) filled: Notify,
    /// Something was taken.
    pub(crate) taken: Notify,
}

struct State {
    waiting: VecDeque<Bytes>,
    closed: bool,
}

impl Inbox {
    pub(crate) fn new(delivery: Delivery) -> Inbox {
        let state = Mutex::new(State { waiting: VecDeque::new(), closed: false });
        Inbox { delivery, state, filled: Notify::new(), taken: Notify::new() }
    }

    pub(crate) fn put(&self, sample: Bytes) {
        let mut state = self.lock();
        if self.delivery == Delivery::Newest {
            state.waiting.clear();
        }
        state.waiting.push_back(sample);
        drop(state);
        self.filled.notify_one();
    }

    /// Puts a sample of a writer that cannot be told to hold back; whether an older one had to go for it.
    pub(crate) fn press_in(&self, sample: Bytes) -> bool {
        let full = self.is_full();
        if full {
            self.lock().waiting.pop_front();
        }
        self.put(sample);
        full
    }

    /// Whether writers should hold back.
    pub(crate) fn is_full(&self) -> bool {
        self.delivery == Delivery::Every && self.lock().waiting.len() >= WAITING
    }

    /// The next sample; `Err` when there will be none.
    pub(crate) fn take(&self) -> Result<Option<Bytes>, Closed> {
        let mut state = self.lock();
        match state.waiting.pop_front() {
            Some(sample) => {
                self.taken.notify_one();
                Ok(Some(sample))
            }
            None if state.closed => Err(Closed),
            None => Ok(None),
        }
    }

    pub(crate) fn close(&self) {
        self.lock().closed = true;
        self.filled.notify_one();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // A panic elsewhere does not make what waits wrong.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Nothing will come any more.
pub(crate) struct Closed;
