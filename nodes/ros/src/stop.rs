//! A flag that ends a node and everything that waits in it.

use std::sync::Arc;
use tokio::sync::watch;

/// A flag that asks tasks to stop. Clones share it.
///
/// ```
/// # use puffer_ros::Stop;
/// # tokio::runtime::Runtime::new().unwrap().block_on(async {
/// let stop = Stop::new();
/// assert_eq!(stop.or(async { 7 }).await, Some(7));
/// stop.stop();
/// assert_eq!(stop.or(std::future::pending::<i32>()).await, None);
/// # });
/// ```
#[derive(Clone, Debug)]
pub struct Stop {
    sender: Arc<watch::Sender<bool>>,
}

impl Default for Stop {
    fn default() -> Self {
        Self { sender: Arc::new(watch::Sender::new(false)) }
    }
}

impl Stop {
    /// A flag that is not set.
    pub fn new() -> Self {
        Self::default()
    }

    /// A flag that SIGINT and SIGTERM set. A second signal ends the process at once, with status
    /// 130. Must be called inside a tokio runtime.
    ///
    /// # Errors
    /// If the system refuses the signal handlers.
    pub fn on_signals() -> anyhow::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        let stop = Self::new();
        let mut interrupt = signal(SignalKind::interrupt())?;
        let mut terminate = signal(SignalKind::terminate())?;
        let flag = stop.clone();
        tokio::spawn(async move {
            loop {
                tokio::select! {
                    _ = interrupt.recv() => {}
                    _ = terminate.recv() => {}
                }
                if flag.is_stopped() {
                    std::process::exit(130);
                }
                flag.stop();
            }
        });
        Ok(stop)
    }

    /// Sets the flag.
    pub fn stop(&self) {
        self.sender.send_replace(true);
    }

    /// Whether the flag is set.
    pub fn is_stopped(&self) -> bool {
        *self.sender.borrow()
    }

    /// Resolves when the flag is set, at once if it is already.
    pub async fn stopped(&self) {
        // Fails only without a sender, and `self` holds one.
        let _ = self.sender.subscribe().wait_for(|stopped| *stopped).await;
    }

    /// Runs `future` until the flag is set: its output, or `None` if the flag is set first.
    pub async fn or<T>(&self, future: impl Future<Output = T>) -> Option<T> {
        tokio::select! {
            biased;
            () = self.stopped() => None,
            value = future => Some(value),
        }
    }

    /// A flag of its own that is set together with this one, but whose setting does not set this
    /// one. Must be called inside a tokio runtime.
    pub fn child(&self) -> Self {
        let child = Self::new();
        let (parent, flag) = (self.clone(), child.clone());
        tokio::spawn(async move {
            tokio::select! {
                () = parent.stopped() => flag.stop(),
                () = flag.stopped() => {}
            }
        });
        child
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_child_follows_its_parent_and_not_the_other_way_round() {
        let parent = Stop::new();
        let (first, second) = (parent.child(), parent.child());
        first.stop();
        first.stopped().await;
        assert!(!parent.is_stopped());
        assert_eq!(parent.or(async { 5 }).await, Some(5));
        parent.stop();
        second.stopped().await;
        assert_eq!(parent.or(std::future::pending::<()>()).await, None);
    }
}
