//! Transforms.

use super::Node;
use crate::{TfBroadcaster, TfBuffer, tf};
use anyhow::Result;
use puffer_core::params::Parameters;
use std::sync::PoisonError;

impl<P: Parameters> Node<P> {
    /// The transforms that this node hears and those that it sends itself, over the last 60 s of stamps; the first
    /// call subscribes `/tf` and `/tf_static`.
    ///
    /// # Errors
    /// No resources.
    pub fn tf(&self) -> Result<TfBuffer> {
        let inner = &self.inner;
        let mut heard = inner.tf_heard.lock().unwrap_or_else(PoisonError::into_inner);
        if !*heard {
            let topics = [&*self.resolve("/tf")?, &*self.resolve("/tf_static")?];
            tf::subscribe(&inner.dds, topics, &inner.tf, &inner.stop)?;
            *heard = true;
        }
        Ok(inner.tf.clone())
    }

    /// Publishes transforms.
    ///
    /// # Errors
    /// No resources.
    pub fn tf_broadcaster(&self) -> Result<TfBroadcaster> {
        let inner = &self.inner;
        let mut sent = inner.tf_sent.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(broadcaster) = &*sent {
            return Ok(broadcaster.clone());
        }
        let topics = [&*self.resolve("/tf")?, &*self.resolve("/tf_static")?];
        let broadcaster = TfBroadcaster::new(&inner.dds, topics, inner.tf.clone())?;
        Ok(sent.insert(broadcaster).clone())
    }
}
