//! Publishers and subscriptions.

use crate::Message;
use anyhow::{Result, bail};
use std::marker::PhantomData;
use std::time::Duration;

/// Publishes messages; clones share it.
#[derive(Clone)]
pub struct Publisher<M> {
    message: PhantomData<fn(M)>,
}

impl<M: Message> Publisher<M> {
    /// Publishes; waits at most 100 ms where the queue is full.
    ///
    /// # Errors
    /// The message cannot be serialised, or the queue stayed full.
    pub fn publish(&self, message: &M) -> Result<()> {
        let _ = message;
        bail!("not yet")
    }

    /// Readers that are matched now.
    pub fn readers(&self) -> usize {
        0
    }

    /// The topic's absolute name.
    pub fn topic(&self) -> &str {
        ""
    }
}

/// Receives messages.
pub struct Subscription<M> {
    message: PhantomData<fn() -> M>,
}

impl<M: Message> Subscription<M> {
    /// The next message, or `None` once the node stops. A message that cannot be decoded is logged and left out.
    pub async fn next(&mut self) -> Option<M> {
        None
    }

    /// The next message.
    ///
    /// # Errors
    /// Nothing came within `deadline`, or the node stops.
    pub async fn next_within(&mut self, deadline: Duration) -> Result<M> {
        bail!("not yet {deadline:?}")
    }

    /// A message that has come already.
    pub fn try_next(&mut self) -> Option<M> {
        None
    }

    /// Writers that are matched now.
    pub fn writers(&self) -> usize {
        0
    }

    /// The topic's absolute name.
    pub fn topic(&self) -> &str {
        ""
    }
}
