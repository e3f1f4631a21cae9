//! Receives transforms from `/tf` and `/tf_static`.

use super::TfBuffer;
use crate::dds::Participant;
use crate::{Stop, Subscription, qos};
use anyhow::Result;
use puffer_msgs::tf2_msgs::msg::TFMessage;

/// Inserts the transforms of `/tf` and `/tf_static` into a buffer until `stop`; `topics` are the
/// resolved names of the two topics.
pub(crate) fn subscribe(
    dds: &Participant,
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
