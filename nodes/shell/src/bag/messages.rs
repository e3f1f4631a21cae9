//! The messages of a bag in the order of time.

use super::block;
use super::error::BagError;
use super::index::{Block, Index};
use super::info::{BagMessage, BagTopic};
use crate::Stamp;
use bytes::Bytes;
use mcap::records::Record;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::fs::File;
use std::path::PathBuf;
use std::sync::Arc;

/// The messages of a bag by the time at which they were recorded; those of one time in the order of the file. Holds the
/// chunks whose times overlap, not the whole bag. Ends after the first error.
pub struct Messages {
    files: Vec<Source>,
    /// Pieces that are still to be read, the earliest last.
    pieces: Vec<(usize, Block)>,
    waiting: BinaryHeap<Reverse<Waiting>>,
}

struct Source {
    path: PathBuf,
    file: File,
    /// Of the channels that are asked for.
    topics: BTreeMap<u16, BagTopic>,
}

struct Waiting {
    /// Time, file, place of the piece and place in the piece.
    key: (u64, usize, u64, usize),
    message: BagMessage,
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

impl Eq for Waiting {}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.key.cmp(&other.key)
    }
}

impl Messages {
    pub(crate) fn new(files: &[Index], wanted: &[&str]) -> Result<Messages, BagError> {
        let mut sources = Vec::new();
        let mut pieces = Vec::new();
        for (number, index) in files.iter().enumerate() {
            let file = File::open(&index.path).map_err(BagError::io(&index.path, "open"))?;
            let mut topics = index.topics.clone();
            topics.retain(|_, topic| wanted.is_empty() || wanted.contains(&&*topic.name));
            if !topics.is_empty() {
                pieces.extend(index.blocks.iter().map(|block| (number, block.clone())));
            }
            sources.push(Source { path: index.path.clone(), file, topics });
        }
        pieces.sort_by_key(|(number, block)| Reverse((block.start, *number, block.at)));
        Ok(Messages { files: sources, pieces, waiting: BinaryHeap::new() })
    }

    /// Reads pieces until no earlier message can come.
    fn fill(&mut self) -> Result<(), BagError> {
        while let Some((number, piece)) = self.pieces.last() {
            let earliest = self.waiting.peek().map(|Reverse(first)| first.key.0);
            if earliest.is_some_and(|time| time < piece.start) {
                break;
            }
            let source = &mut self.files[*number];
            let bytes = block::read(&mut source.file, &source.path, piece)?;
            let (topics, waiting) = (&source.topics, &mut self.waiting);
            let mut place = 0;
            let read = block::records(&bytes, |record| {
                let Record::Message { header, data } = record else { return Ok(()) };
                let Some(topic) = topics.get(&header.channel_id) else { return Ok(()) };
                place += 1;
                waiting.push(Reverse(Waiting {
                    key: (header.log_time, *number, piece.at, place),
                    message: BagMessage {
                        topic: Arc::clone(&topic.name),
                        type_name: Arc::clone(&topic.type_name),
                        bytes: Bytes::copy_from_slice(&data),
                        log_time: stamp(header.log_time),
                        publish_time: stamp(header.publish_time),
                    },
                }));
                Ok(())
            });
            read.map_err(|error| BagError::Damaged {
                path: source.path.clone(),
                at: piece.at,
                reason: error.to_string(),
            })?;
            self.pieces.pop();
        }
        Ok(())
    }
}

impl Iterator for Messages {
    type Item = Result<BagMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Err(error) = self.fill() {
            self.pieces.clear();
            self.waiting.clear();
            return Some(Err(error));
        }
        self.waiting.pop().map(|Reverse(first)| Ok(first.message))
    }
}

pub(crate) fn stamp(nanos: u64) -> Stamp {
    Stamp::from_nanos(i64::try_from(nanos).unwrap_or(i64::MAX))
}
