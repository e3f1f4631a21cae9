//! Recording topics into a file.

use super::error::BagError;
use super::info::BagMessage;
use super::record::record;
use super::route::TopicRoute;
use super::writer::BagWriter;
use crate::Node;
use anyhow::{Context, Result};
use puffer_core::params::Parameters;
use std::time::{Duration, Instant};
use tokio::runtime::Handle;
use tokio::sync::mpsc::Receiver;
use tokio::task::JoinHandle;

/// A recording that dies loses no more than this.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// A recording that goes on.
pub struct Recording {
    task: JoinHandle<Result<u64, BagError>>,
}

impl Recording {
    /// Records the topics (see [`record`]) until the node stops. What is older than a second is safe in the file
    /// whatever happens to the process. Must be called inside a tokio runtime.
    ///
    /// # Errors
    /// As [`record`] and [`BagWriter::add_topic`].
    pub fn start<P: Parameters>(
        node: &Node<P>,
        topics: &[TopicRoute],
        mut bag: BagWriter,
    ) -> Result<Recording> {
        for entry in topics {
            bag.add_topic(&node.resolve(&entry.topic)?, &entry.type_name, entry.profile())?;
        }
        bag.flush()?;
        let messages = record(node, topics)?;
        let runtime = Handle::current();
        let task = tokio::task::spawn_blocking(move || {
            let written = write(&runtime, messages, &mut bag);
            // Whatever broke the recording, what is there should be a whole bag.
            let finished = bag.finish();
            written.and_then(|count| finished.map(|()| count))
        });
        Ok(Recording { task })
    }

    /// Waits until the node has stopped and the bag is closed; gives the number of messages.
    ///
    /// # Errors
    /// The disk is full or the like; no message is taken from then on.
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
        let left = FLUSH_EVERY.saturating_sub(flushed.elapsed());
        match runtime.block_on(async { tokio::time::timeout(left, messages.recv()).await }) {
            Ok(Some(m)) => {
                bag.write(&m.topic, &m.type_name, &m.bytes, m.log_time, m.publish_time)?;
                (count, dirty) = (count + 1, true);
            }
            Ok(None) => return Ok(count),
            Err(_) => {}
        }
        if flushed.elapsed() >= FLUSH_EVERY {
            if std::mem::take(&mut dirty) {
                bag.flush()?;
            }
            flushed = Instant::now();
        }
    }
}
