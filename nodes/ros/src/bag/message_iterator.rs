//! The messages of a bag in the order of their log times.

use super::bag_error::BagError;
use super::bag_info::{BagMessage, BagTopic};
use super::block_reader;
use super::file_index::{Block, FileIndex};
use crate::Stamp;
use bytes::Bytes;
use mcap::records::Record;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::fs::File;
use std::path::PathBuf;
use std::sync::Arc;

/// The messages of a bag by log time, and those of one log time in the order of the file. It holds
/// the chunks whose times overlap in memory, not the whole bag. It ends after the first error.
///
/// It is made by [`BagReader::messages`](super::BagReader::messages).
pub struct Messages {
    files: Vec<Source>,
    /// The blocks that are still to be read, by number of the file, the earliest last.
    unread: Vec<(usize, Block)>,
    /// Messages that were read, the earliest first.
    queue: BinaryHeap<Reverse<QueuedMessage>>,
}

/// An open file.
struct Source {
    path: PathBuf,
    file: File,
    /// The requested topics, by the numbers of their channels.
    topics: BTreeMap<u16, BagTopic>,
}

/// A message in the order of [`Messages`].
struct QueuedMessage {
    /// Log time, number of the file, position of the block, and position in the block.
    key: (u64, usize, u64, usize),
    message: BagMessage,
}

impl PartialEq for QueuedMessage {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

impl Eq for QueuedMessage {}

impl PartialOrd for QueuedMessage {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for QueuedMessage {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.key.cmp(&other.key)
    }
}

impl Messages {
    pub(crate) fn new(files: &[FileIndex], wanted: &[&str]) -> Result<Messages, BagError> {
        let mut sources = Vec::new();
        let mut unread = Vec::new();
        for (number, index) in files.iter().enumerate() {
            let file = File::open(&index.path).map_err(BagError::io(&index.path, "open"))?;
            let mut topics = index.topics.clone();
            topics.retain(|_, topic| wanted.is_empty() || wanted.contains(&&*topic.name));
            if !topics.is_empty() {
                unread.extend(index.blocks.iter().map(|block| (number, block.clone())));
            }
            sources.push(Source { path: index.path.clone(), file, topics });
        }
        unread.sort_by_key(|(number, block)| Reverse((block.start, *number, block.at)));
        Ok(Messages { files: sources, unread, queue: BinaryHeap::new() })
    }

    /// Reads blocks until no earlier message can come.
    fn fill(&mut self) -> Result<(), BagError> {
        while let Some((number, block)) = self.unread.last() {
            let earliest = self.queue.peek().map(|Reverse(first)| first.key.0);
            if earliest.is_some_and(|time| time < block.start) {
                break;
            }
            let source = &mut self.files[*number];
            let bytes = block_reader::read(&mut source.file, &source.path, block)?;
            let (topics, queue) = (&source.topics, &mut self.queue);
            let mut position = 0;
            let read = block_reader::records(&bytes, |record| {
                let Record::Message { header, data } = record else { return Ok(()) };
                let Some(topic) = topics.get(&header.channel_id) else { return Ok(()) };
                position += 1;
                queue.push(Reverse(QueuedMessage {
                    key: (header.log_time, *number, block.at, position),
                    message: BagMessage {
                        topic: Arc::clone(&topic.name),
                        type_name: Arc::clone(&topic.type_name),
                        bytes: Bytes::copy_from_slice(&data),
                        log_time: stamp_from_log_time(header.log_time),
                        publish_time: stamp_from_log_time(header.publish_time),
                    },
                }));
                Ok(())
            });
            read.map_err(|error| BagError::Damaged {
                path: source.path.clone(),
                at: block.at,
                reason: error.to_string(),
            })?;
            self.unread.pop();
        }
        Ok(())
    }
}

impl Iterator for Messages {
    type Item = Result<BagMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Err(error) = self.fill() {
            self.unread.clear();
            self.queue.clear();
            return Some(Err(error));
        }
        self.queue.pop().map(|Reverse(first)| Ok(first.message))
    }
}

/// A log time of MCAP as a stamp.
pub(crate) fn stamp_from_log_time(nanos: u64) -> Stamp {
    Stamp::from_nanos(i64::try_from(nanos).unwrap_or(i64::MAX))
}
