//! Publishes transforms on `/tf` and `/tf_static`.

use super::{TfBuffer, Transform};
use crate::conversions::transform_message;
use crate::dds::Participant;
use crate::{Publisher, QosProfile, qos};
use anyhow::Result;
use puffer_msgs::geometry_msgs::msg::TransformStamped;
use puffer_msgs::std_msgs::msg::Header;
use puffer_msgs::tf2_msgs::msg::TFMessage;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Publishes transforms, and inserts them into the own node's [`TfBuffer`], too. Clones share the
/// broadcaster.
///
/// It is made by [`Node::tf_broadcaster`](crate::Node::tf_broadcaster).
#[derive(Clone)]
pub struct TfBroadcaster {
    moving: Publisher<TFMessage>,
    fixed: Publisher<TFMessage>,
    /// The static transforms sent so far, by child frame: a latched topic keeps only one message.
    sent: Arc<Mutex<BTreeMap<String, Transform>>>,
    own: TfBuffer,
}

impl TfBroadcaster {
    /// `topics` are the resolved names of `/tf` and `/tf_static`.
    pub(crate) fn new(dds: &Participant, topics: [&str; 2], own: TfBuffer) -> Result<Self> {
        Ok(Self {
            moving: Publisher::new(dds, topics[0], &qos::transforms())?,
            fixed: Publisher::new(dds, topics[1], &QosProfile::Latched.policies())?,
            sent: Arc::default(),
            own,
        })
    }

    /// Publishes moving transforms on `/tf`.
    ///
    /// # Errors
    /// If the queue stayed full.
    pub fn send(&self, transforms: &[Transform]) -> Result<()> {
        self.insert_own(transforms, false);
        self.moving
            .publish(&TFMessage { transforms: transforms.iter().map(transform_stamped).collect() })
    }

    /// Publishes static transforms on `/tf_static`, together with all that were sent before, so
    /// that late joiners get them.
    ///
    /// # Errors
    /// If the queue stayed full.
    pub fn send_static(&self, transforms: &[Transform]) -> Result<()> {
        self.insert_own(transforms, true);
        let mut sent = self.sent.lock().unwrap_or_else(PoisonError::into_inner);
        for transform in transforms {
            sent.insert(transform.child.clone(), transform.clone());
        }
        self.fixed
            .publish(&TFMessage { transforms: sent.values().map(transform_stamped).collect() })
    }

    /// Inserts transforms into the own buffer: on a host with loopback only, a DDS participant does
    /// not receive its own samples.
    fn insert_own(&self, transforms: &[Transform], is_static: bool) {
        for transform in transforms {
            self.own.insert(transform.clone(), is_static);
        }
    }
}

fn transform_stamped(transform: &Transform) -> TransformStamped {
    TransformStamped {
        header: Header { stamp: transform.stamp.into(), frame_id: transform.parent.clone() },
        child_frame_id: transform.child.clone(),
        transform: transform_message(&transform.pose),
    }
}
