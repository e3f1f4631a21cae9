//! A value that the tasks of a node share, and a wait for it to become what a task needs.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{Mutex, MutexGuard, watch};
use tokio::time::Instant;

/// A value behind an asynchronous lock that tells waiting tasks when it changes. Clones share the
/// value.
pub struct Shared<T> {
    inner: Arc<Lock<T>>,
}

struct Lock<T> {
    value: Mutex<T>,
    /// Notified after each change of the value.
    changes: watch::Sender<()>,
}

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        Self { inner: Arc::clone(&self.inner) }
    }
}

impl<T: Default> Default for Shared<T> {
    fn default() -> Self {
        Self::new(T::default())
    }
}

impl<T> Shared<T> {
    /// Shares `value`.
    pub fn new(value: T) -> Self {
        let changes = watch::Sender::new(());
        Self { inner: Arc::new(Lock { value: Mutex::new(value), changes }) }
    }

    /// Locks the value. If the guard is used to change the value, all waiting tasks look at it
    /// again once the guard is dropped.
    pub async fn lock(&self) -> SharedGuard<'_, T> {
        let value = self.inner.value.lock().await;
        SharedGuard { value, changes: &self.inner.changes, is_changed: false }
    }

    /// Waits until `probe` returns `Ok`, and returns what it found. `probe` sees the value at once
    /// and again after each change.
    ///
    /// # Errors
    /// After `deadline` (wall time) the newest error of `probe`, which names what is still missing.
    /// Time during which another task holds the lock counts, but does not cut the last probe off.
    pub async fn wait_until<R, E>(
        &self,
        deadline: Duration,
        mut probe: impl FnMut(&T) -> Result<R, E>,
    ) -> Result<R, E> {
        let end = Instant::now() + deadline;
        let mut changes = self.inner.changes.subscribe();
        loop {
            // A change from here on is noticed below, also one that happens before the probe.
            changes.borrow_and_update();
            let missing = match probe(&*self.inner.value.lock().await) {
                Ok(found) => return Ok(found),
                Err(missing) => missing,
            };
            if tokio::time::timeout_at(end, changes.changed()).await.is_err() {
                return Err(missing);
            }
        }
    }
}

/// A lock on the value of a [`Shared`]; dropping it tells waiting tasks of a change.
pub struct SharedGuard<'a, T> {
    value: MutexGuard<'a, T>,
    changes: &'a watch::Sender<()>,
    is_changed: bool,
}

impl<T> Deref for SharedGuard<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for SharedGuard<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        self.is_changed = true;
        &mut self.value
    }
}

impl<T> Drop for SharedGuard<'_, T> {
    fn drop(&mut self) {
        // The lock is released after this; a task that wakes earlier waits for it.
        if self.is_changed {
            self.changes.send_replace(());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEADLINE: Duration = Duration::from_secs(30);

    fn at_least(wanted: u32) -> impl FnMut(&u32) -> Result<u32, String> {
        move |value| {
            if *value >= wanted { Ok(*value) } else { Err(format!("{value} of {wanted} came")) }
        }
    }

    /// Counts up once a second.
    fn count_up(shared: &Shared<u32>) -> tokio::task::JoinHandle<()> {
        let shared = shared.clone();
        tokio::spawn(async move {
            let mut ticks = tokio::time::interval(Duration::from_secs(1));
            ticks.tick().await;
            loop {
                ticks.tick().await;
                *shared.lock().await += 1;
            }
        })
    }

    #[tokio::test(start_paused = true)]
    async fn a_value_that_is_there_is_found_without_any_wait() {
        let shared = Shared::new(3);
        let begin = Instant::now();
        assert_eq!(shared.wait_until(Duration::ZERO, at_least(3)).await, Ok(3));
        assert_eq!(begin.elapsed(), Duration::ZERO);
    }

    #[tokio::test(start_paused = true)]
    async fn a_wait_ends_with_the_change_that_it_waits_for() {
        let shared = Shared::new(0);
        let counter = count_up(&shared);
        let begin = Instant::now();
        assert_eq!(shared.wait_until(DEADLINE, at_least(5)).await, Ok(5));
        assert_eq!(begin.elapsed(), Duration::from_secs(5));
        counter.abort();
    }

    #[tokio::test(start_paused = true)]
    async fn after_the_deadline_the_newest_error_says_what_is_missing() {
        let shared = Shared::new(0);
        let counter = count_up(&shared);
        let begin = Instant::now();
        let missing = shared.wait_until(Duration::from_millis(3500), at_least(5)).await;
        assert_eq!(missing, Err("3 of 5 came".to_owned()));
        assert_eq!(begin.elapsed(), Duration::from_millis(3500));
        counter.abort();
    }

    #[tokio::test(start_paused = true)]
    async fn reading_wakes_nobody_and_changing_wakes_all() {
        let shared = Shared::new(0);
        let mut changes = shared.inner.changes.subscribe();
        assert_eq!(*shared.lock().await, 0);
        assert!(!changes.has_changed().unwrap());
        let waits: Vec<_> = (0..3)
            .map(|_| {
                let shared = shared.clone();
                tokio::spawn(async move { shared.wait_until(DEADLINE, at_least(7)).await })
            })
            .collect();
        tokio::task::yield_now().await;
        *shared.lock().await = 7;
        assert!(changes.has_changed().unwrap());
        changes.borrow_and_update();
        for wait in waits {
            assert_eq!(wait.await.unwrap(), Ok(7));
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_lock_held_past_the_deadline_does_not_hide_what_came_meanwhile() {
        let shared = Shared::new(0);
        let mut guard = shared.lock().await;
        let wait = tokio::spawn({
            let shared = shared.clone();
            async move { shared.wait_until(Duration::from_secs(1), at_least(1)).await }
        });
        tokio::time::sleep(Duration::from_secs(60)).await;
        *guard = 1;
        drop(guard);
        assert_eq!(wait.await.unwrap(), Ok(1));
    }
}
