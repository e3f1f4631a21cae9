//! The transforms of a node.

use super::Node;
use crate::{TfBroadcaster, TfBuffer, tf};
use anyhow::Result;
use puffer_core::params::Parameters;
use std::sync::PoisonError;

impl<P: Parameters> Node<P> {
    /// The transforms that this node receives and those that it sends itself, over the last 60 s of
    /// stamps. The first call subscribes to `/tf` and `/tf_static`.
    ///
    /// # Errors
    /// If DDS makes no endpoints.
    pub fn tf(&self) -> Result<TfBuffer> {
        let inner = &self.inner;
        let mut is_subscribed =
            inner.is_tf_subscribed.lock().unwrap_or_else(PoisonError::into_inner);
        if !*is_subscribed {
            let topics = [&*self.resolve("/tf")?, &*self.resolve("/tf_static")?];
            tf::subscribe(&inner.dds, topics, &inner.tf, &inner.stop)?;
            *is_subscribed = true;
        }
        Ok(inner.tf.clone())
    }

    /// The publisher of transforms of this node.
    ///
    /// # Errors
    /// If DDS makes no endpoints.
    pub fn tf_broadcaster(&self) -> Result<TfBroadcaster> {
        let inner = &self.inner;
        let mut broadcaster = inner.tf_broadcaster.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = &*broadcaster {
            return Ok(known.clone());
        }
        let topics = [&*self.resolve("/tf")?, &*self.resolve("/tf_static")?];
        let new = TfBroadcaster::new(&inner.dds, topics, inner.tf.clone())?;
        Ok(broadcaster.insert(new).clone())
    }
}
