//! Transforms on `/tf` and `/tf_static`.

use super::{TfBuffer, Transform};
use crate::convert::transform_message;
use crate::dds::Dds;
use crate::{Profile, Publisher, Stop, Subscription, qos};
use anyhow::Result;
use puffer_msgs::builtin_interfaces::msg::Time;
use puffer_msgs::geometry_msgs::msg::TransformStamped;
use puffer_msgs::std_msgs::msg::Header;
use puffer_msgs::tf2_msgs::msg::TFMessage;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Publishes transforms, and tells them to the own node's [`TfBuffer`] too; clones share it.
#[derive(Clone)]
pub struct TfBroadcaster {
    moving: Publisher<TFMessage>,
    fixed: Publisher<TFMessage>,
    /// Static transforms by child frame: a latched topic keeps one message only.
    sent: Arc<Mutex<BTreeMap<String, Transform>>>,
    own: TfBuffer,
}

impl TfBroadcaster {
    /// `topics` are the resolved names of `/tf` and `/tf_static`.
    pub(crate) fn new(dds: &Dds, topics: [&str; 2], own: TfBuffer) -> Result<Self> {
        Ok(Self {
            moving: Publisher::new(dds, topics[0], &qos::transforms())?,
            fixed: Publisher::new(dds, topics[1], &Profile::Latched.policies())?,
            sent: Arc::default(),
            own,
        })
    }

    /// Publishes on `/tf`.
    ///
    /// # Errors
    /// The queue stayed full.
    pub fn send(&self, transforms: &[Transform]) -> Result<()> {
        self.tell_own(transforms, false);
        self.moving.publish(&TFMessage { transforms: transforms.iter().map(to_ros).collect() })
    }

    /// Publishes on `/tf_static`, together with all static transforms sent before, so that late joiners get
    /// them.
    ///
    /// # Errors
    /// The queue stayed full.
    pub fn send_static(&self, transforms: &[Transform]) -> Result<()> {
        self.tell_own(transforms, true);
        let mut sent = self.sent.lock().unwrap_or_else(PoisonError::into_inner);
        for transform in transforms {
            sent.insert(transform.child.clone(), transform.clone());
        }
        self.fixed.publish(&TFMessage { transforms: sent.values().map(to_ros).collect() })
    }

    /// On a host with loopback only, a DDS participant does not hear itself.
    fn tell_own(&self, transforms: &[Transform], is_static: bool) {
        for transform in transforms {
            self.own.insert(transform.clone(), is_static);
        }
    }
}

/// Fills a buffer from `/tf` and `/tf_static`, whose resolved names `topics` are, until `stop`.
pub(crate) fn subscribe(
    dds: &Dds,
    topics: [&str; 2],
    buffer: &TfBuffer,
    stop: &Stop,
) -> Result<()> {
    let moving = Subscription::new(dds, topics[0], &qos::transforms(), stop.clone())?;
    let fixed = Subscription::new(dds, topics[1], &qos::static_transforms(), stop.clone())?;
    tokio::spawn(fill(moving, buffer.clone(), false));
    tokio::spawn(fill(fixed, buffer.clone(), true));
    Ok(())
}

async fn fill(mut messages: Subscription<TFMessage>, buffer: TfBuffer, is_static: bool) {
    while let Some(message) = messages.next().await {
        if let Err(reason) = buffer.insert_message(&message, is_static) {
            tracing::warn!("a transform on {} is left out: {reason}", messages.topic());
        }
    }
}

fn to_ros(transform: &Transform) -> TransformStamped {
    let (sec, nanosec) = transform.stamp.parts();
    TransformStamped {
        header: Header { stamp: Time { sec, nanosec }, frame_id: transform.parent.clone() },
        child_frame_id: transform.child.clone(),
        transform: transform_message(&transform.pose),
    }
}
