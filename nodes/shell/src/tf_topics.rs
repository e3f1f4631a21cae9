//! `/tf` and `/tf_static`: heard into a buffer, and published.

use crate::convert::{pose_from_transform, transform_message};
use crate::dds::Dds;
use crate::{Publisher, Stop, Subscription, TfBuffer, Transform, qos};
use anyhow::Result;
use puffer_msgs::geometry_msgs::msg::TransformStamped;
use puffer_msgs::std_msgs::msg::Header;
use puffer_msgs::tf2_msgs::msg::TFMessage;
use rustdds::policy::Durability;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Transforms waiting for a reader or writer.
const DEPTH: i32 = 100;

/// Fills `buffer` until `stop`; the topics' names are resolved.
pub(crate) fn listen(dds: &Dds, topics: [&str; 2], buffer: &TfBuffer, stop: &Stop) -> Result<()> {
    let moving = Subscription::new(dds, topics[0], &qos::transforms(), stop.clone())?;
    let latched = qos::build(true, Durability::TransientLocal, DEPTH);
    let fixed = Subscription::new(dds, topics[1], &latched, stop.clone())?;
    for (subscription, is_static) in [(moving, false), (fixed, true)] {
        tokio::spawn(fill(subscription, buffer.clone(), is_static));
    }
    Ok(())
}

async fn fill(mut transforms: Subscription<TFMessage>, buffer: TfBuffer, is_static: bool) {
    while let Some(message) = transforms.next().await {
        for stamped in message.transforms {
            match transform(stamped) {
                Ok(transform) => buffer.insert(transform, is_static),
                Err(error) => tracing::warn!("{}: {error}", transforms.topic()),
            }
        }
    }
}

fn transform(stamped: TransformStamped) -> Result<Transform, String> {
    // tf 1 wrote a slash in front of frames, and some still do.
    let frame = |name: String| name.trim_start_matches('/').to_owned();
    let (parent, child) = (frame(stamped.header.frame_id), frame(stamped.child_frame_id));
    let pose = pose_from_transform(&stamped.transform)
        .map_err(|error| format!("transform {parent} <- {child} ignored: {error}"))?;
    Ok(Transform { parent, child, stamp: stamped.header.stamp.into(), pose })
}

fn stamped(transform: &Transform) -> TransformStamped {
    TransformStamped {
        header: Header { stamp: transform.stamp.into(), frame_id: transform.parent.clone() },
        child_frame_id: transform.child.clone(),
        transform: transform_message(&transform.pose),
    }
}

/// Publishes transforms, and tells them to the own node's [`TfBuffer`] too; clones share it.
#[derive(Clone)]
pub struct TfBroadcaster {
    moving: Publisher<TFMessage>,
    fixed: Publisher<TFMessage>,
    /// All static transforms so far, by child frame.
    sent: Arc<Mutex<BTreeMap<String, TransformStamped>>>,
    own: TfBuffer,
}

impl TfBroadcaster {
    /// The topics' names are resolved.
    pub(crate) fn new(dds: &Dds, topics: [&str; 2], own: TfBuffer) -> Result<Self> {
        let latched = qos::build(true, Durability::TransientLocal, 1);
        Ok(Self {
            moving: Publisher::new(dds, topics[0], &qos::transforms())?,
            fixed: Publisher::new(dds, topics[1], &latched)?,
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
        self.moving.publish(&TFMessage { transforms: transforms.iter().map(stamped).collect() })
    }

    /// Publishes on `/tf_static`, together with all static transforms sent before, so that late joiners get them.
    ///
    /// # Errors
    /// The queue stayed full.
    pub fn send_static(&self, transforms: &[Transform]) -> Result<()> {
        self.tell_own(transforms, true);
        let mut sent = self.sent.lock().unwrap_or_else(PoisonError::into_inner);
        for transform in transforms {
            sent.insert(transform.child.clone(), stamped(transform));
        }
        self.fixed.publish(&TFMessage { transforms: sent.values().cloned().collect() })
    }

    /// On a host with loopback only, a DDS participant does not hear itself.
    fn tell_own(&self, transforms: &[Transform], is_static: bool) {
        for transform in transforms {
            self.own.insert(transform.clone(), is_static);
        }
    }
}
