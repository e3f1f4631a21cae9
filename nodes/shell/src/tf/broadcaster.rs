//! Transforms on `/tf` and `/tf_static`.

use super::{TfBuffer, Transform};
use crate::dds::Dds;
use crate::{Profile, Publisher, Stamp, Stop, Subscription, qos};
use anyhow::Result;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use puffer_core::geometry::Pose;
use puffer_msgs::geometry_msgs::msg::TransformStamped;
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
        for transform in &message.transforms {
            match from_ros(transform) {
                Ok(transform) => buffer.insert(transform, is_static),
                Err(error) => tracing::warn!("{}: transform ignored: {error}", messages.topic()),
            }
        }
    }
}

fn to_ros(transform: &Transform) -> TransformStamped {
    let mut ros = TransformStamped::default();
    ros.header.stamp = transform.stamp.into();
    ros.header.frame_id.clone_from(&transform.parent);
    ros.child_frame_id.clone_from(&transform.child);
    let (t, q) = (&transform.pose.translation, &transform.pose.rotation);
    (ros.transform.translation.x, ros.transform.translation.y, ros.transform.translation.z) =
        (t.x, t.y, t.z);
    let rotation = &mut ros.transform.rotation;
    (rotation.x, rotation.y, rotation.z, rotation.w) = (q.i, q.j, q.k, q.w);
    ros
}

/// The transform, if its numbers are finite and its rotation is of length 1 to one part in a thousand.
pub(crate) fn from_ros(ros: &TransformStamped) -> Result<Transform, String> {
    let (t, q) = (&ros.transform.translation, &ros.transform.rotation);
    let quaternion = Quaternion::new(q.w, q.x, q.y, q.z);
    let length = quaternion.norm();
    let finite = [t.x, t.y, t.z, length].iter().all(|number| number.is_finite());
    let (parent, child) = (&ros.header.frame_id, &ros.child_frame_id);
    if !finite || (length - 1.0).abs() > 1e-3 {
        return Err(format!(
            "{parent} <- {child}: its rotation has length {length:.4}, or a number is not finite"
        ));
    }
    if parent == child || parent.is_empty() || child.is_empty() {
        return Err(format!("`{parent}` <- `{child}`: two different frames are needed"));
    }
    Ok(Transform {
        parent: parent.clone(),
        child: child.clone(),
        stamp: Stamp::from(ros.header.stamp),
        pose: Pose::from_parts(
            Translation3::new(t.x, t.y, t.z),
            // Bits that came in stay as they are where they are a unit quaternion already.
            if (length - 1.0).abs() < 1e-12 {
                UnitQuaternion::new_unchecked(quaternion)
            } else {
                UnitQuaternion::new_normalize(quaternion)
            },
        ),
    })
}
