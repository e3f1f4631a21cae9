//! Records topics into a file.

use super::bag_error::BagError;
use super::bag_info::BagMessage;
use super::topic_receiver::receive_topics;
use super::topic_route::TopicRoute;
use super::writer::BagWriter;
use crate::Node;
use anyhow::{Context, Result};
use puffer_core::params::Parameters;
use std::time::{Duration, Instant};
use tokio::runtime::Handle;
use tokio::sync::mpsc::Receiver;
use tokio::task::JoinHandle;

/// How often what was recorded is given to the operating system: a process that dies loses no more.
const FLUSH_PERIOD: Duration = Duration::from_secs(1);

/// A recording in progress.
pub struct Recording {
    task: JoinHandle<Result<u64, BagError>>,
}

impl Recording {
    /// Records the topics (see [`receive_topics`]) into `bag` until the node stops. Messages older
    /// than a second are safe in the file whatever happens to the process. Must be called inside a
    /// tokio runtime.
    ///
    /// # Errors
    /// Those of [`receive_topics`] and [`BagWriter::add_topic`].
    pub fn start<P: Parameters>(
        node: &Node<P>,
        topics: &[TopicRoute],
        mut bag: BagWriter,
    ) -> Result<Recording> {
        for entry in topics {
            bag.add_topic(&node.resolve(&entry.topic)?, &entry.type_name, entry.profile())?;
        }
        bag.flush()?;
        let messages = receive_topics(node, topics)?;
        let runtime = Handle::current();
        let task = tokio::task::spawn_blocking(move || {
            let written = write(&runtime, messages, &mut bag);
            // Whatever broke the recording off, what was written should be a complete bag.
            let finished = bag.finish();
            written.and_then(|count| finished.map(|()| count))
        });
        Ok(Recording { task })
    }

    /// Waits until the node has stopped and the bag is closed; returns the number of messages.
    ///
    /// # Errors
    /// If the file could not be written, as on a full disk; no message was recorded from then on.
    pub async fn finished(self) -> Result<u64> {
        Ok(self.task.await.context("the recording broke off")??)
    }
}

fn write(
    runtime: &Handle,
    mut messages: Receiver<BagMessage>,
    bag: &mut BagWriter,
) -> Result<u64, BagError> {
    let (mut count, mut dirty, mut flushed) = (0, false, Instant::now());
    loop {
        let left = FLUSH_PERIOD.saturating_sub(flushed.elapsed());
        match runtime.block_on(async { tokio::time::timeout(left, messages.recv()).await }) {
            Ok(Some(m)) => {
                bag.write(&m.topic, &m.type_name, &m.bytes, m.log_time, m.publish_time)?;
                (count, dirty) = (count + 1, true);
            }
            Ok(None) => return Ok(count),
            Err(_) => {}
        }
        if flushed.elapsed() >= FLUSH_PERIOD {
            if std::mem::take(&mut dirty) {
                bag.flush()?;
            }
            flushed = Instant::now();
        }
    }
}
