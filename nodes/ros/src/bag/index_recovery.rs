//! Makes the index of a file without one from all of its records: of a recording that was cut off,
//! or written without an index.

use super::bag_error::BagError;
use super::block_reader::{self, MAX_RECORD_BYTES, RECORD_HEADER_BYTES};
use super::file_index::{Block, FileIndex, topic_from_channel};
use mcap::McapResult;
use mcap::read::ChannelAccumulator;
use mcap::records::{Record, op};
use std::fs::File;
use std::io::{Seek, SeekFrom};
use std::path::Path;

/// Messages without a chunk are put together into blocks of about this size.
const TARGET_BLOCK_BYTES: u64 = 1 << 20;

/// Reads the whole file, `size` bytes, and keeps what can be read of it.
pub(crate) fn index(file: &mut File, path: &Path, size: u64) -> Result<FileIndex, BagError> {
    let index = FileIndex { path: path.to_owned(), ..FileIndex::default() };
    let mut recovery =
        IndexRecovery { index, channels: ChannelAccumulator::default(), open_block: None };
    let mut at = mcap::MAGIC.len() as u64;
    loop {
        if at + RECORD_HEADER_BYTES > size {
            recovery.note_early_end(at, "the end of the file is missing");
            break;
        }
        let header = block_reader::read(file, path, &empty_block(at, RECORD_HEADER_BYTES))?;
        let opcode = header[0];
        let length = RECORD_HEADER_BYTES.saturating_add(u64_from_le_bytes(&header[1..]));
        if matches!(opcode, op::DATA_END | op::FOOTER) {
            break;
        }
        if length > MAX_RECORD_BYTES || opcode == 0 {
            recovery.note_early_end(at, "what follows is no MCAP");
            break;
        }
        if at + length > size {
            recovery.note_early_end(at, "the file ends in the middle of a record");
            break;
        }
        if matches!(opcode, op::CHUNK | op::MESSAGE | op::SCHEMA | op::CHANNEL | op::METADATA) {
            let bytes = block_reader::read(file, path, &empty_block(at, length))?;
            recovery.on_record(opcode, at, &bytes);
        }
        at += length;
    }
    recovery.close_block();
    file.seek(SeekFrom::Start(0)).map_err(BagError::io(path, "read"))?;
    Ok(recovery.index)
}

/// A block without messages, at position `at`.
fn empty_block(at: u64, length: u64) -> Block {
    Block { at, length, start: u64::MAX, end: 0 }
}

fn u64_from_le_bytes(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

/// What was found so far.
struct IndexRecovery {
    index: FileIndex,
    channels: ChannelAccumulator<'static>,
    /// Messages in a row without a chunk, so far.
    open_block: Option<Block>,
}

impl IndexRecovery {
    /// Takes one record with its header.
    fn on_record(&mut self, opcode: u8, at: u64, bytes: &[u8]) {
        if opcode == op::METADATA {
            match mcap::parse_record(opcode, &bytes[RECORD_HEADER_BYTES as usize..]) {
                Ok(Record::Metadata(notes)) => {
                    self.index.metadata.push((notes.name, notes.metadata));
                }
                _ => self.note_damage(at, "unreadable metadata"),
            }
            return;
        }
        let mut block = empty_block(at, bytes.len() as u64);
        let mut counts = Vec::new();
        let (index, channels) = (&mut self.index, &mut self.channels);
        let read = block_reader::records(bytes, |record| {
            index_record(record, index, channels, &mut block, &mut counts)
        });
        if let Err(error) = read {
            self.note_damage(at, &error.to_string());
            return;
        }
        for topic in &counts {
            self.index.topics.entry(*topic).and_modify(|topic| topic.count += 1);
        }
        if opcode == op::CHUNK {
            self.close_block();
            self.index.blocks.push(block);
        } else if opcode == op::MESSAGE {
            self.add_to_open_block(block);
        }
    }

    fn add_to_open_block(&mut self, block: Block) {
        match &mut self.open_block {
            Some(open) if open.at + open.length == block.at && open.length < TARGET_BLOCK_BYTES => {
                open.length += block.length;
                open.start = open.start.min(block.start);
                open.end = open.end.max(block.end);
            }
            _ => {
                self.close_block();
                self.open_block = Some(block);
            }
        }
    }

    fn close_block(&mut self) {
        self.index.blocks.extend(self.open_block.take());
    }

    /// Notes that a record at `at` cannot be read.
    fn note_damage(&mut self, at: u64, reason: &str) {
        self.index.damage.push(format!("byte {at}: {reason}; this piece is left out"));
    }

    /// Notes that the file cannot be read from `at` on.
    fn note_early_end(&mut self, at: u64, reason: &str) {
        let count: u64 = self.index.topics.values().map(|topic| topic.count).sum();
        let count = format!("{count} messages before it can be read");
        self.index
            .damage
            .push(format!("byte {at}: {reason} (was the recording cut off?); {count}"));
    }
}

/// Adds what a record announces to the index and the block; `counts` gets the channel of a message.
fn index_record(
    record: Record<'_>,
    index: &mut FileIndex,
    channels: &mut ChannelAccumulator<'static>,
    block: &mut Block,
    counts: &mut Vec<u16>,
) -> McapResult<()> {
    match record {
        Record::Schema { header, data } => {
            channels.add_schema(header, data.into_owned().into())?;
        }
        Record::Channel(channel) => {
            let id = channel.id;
            channels.add_channel(channel)?;
            if let Some(channel) = channels.get(id) {
                index.topics.entry(id).or_insert_with(|| topic_from_channel(&channel));
            }
        }
        Record::Message { header, .. } => {
            counts.push(header.channel_id);
            block.start = block.start.min(header.log_time);
            block.end = block.end.max(header.log_time);
        }
        _ => {}
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stamp;
    use crate::bag::BagWriter;
    use crate::bag::index_summary;
    use puffer_msgs::rosgraph_msgs::msg::Clock;
    use puffer_msgs::{Interface, cdr};
    use std::collections::BTreeMap;

    fn recovery() -> IndexRecovery {
        let (index, channels) = (FileIndex::default(), ChannelAccumulator::default());
        IndexRecovery { index, channels, open_block: None }
    }

    fn message_block(at: u64, length: u64, time: u64) -> Block {
        Block { at, length, start: time, end: time }
    }

    #[test]
    fn a_length_is_little_endian() {
        assert_eq!(u64_from_le_bytes(&[1, 2, 0, 0, 0, 0, 0, 0]), 513);
        assert_eq!(u64_from_le_bytes(&[255; 8]), u64::MAX);
        assert_eq!(u64_from_le_bytes(&[]), 0);
    }

    #[test]
    fn messages_in_a_row_make_one_block_up_to_its_size() {
        let mut recovery = recovery();
        recovery.add_to_open_block(message_block(100, 50, 7));
        recovery.add_to_open_block(message_block(150, 50, 3));
        // A gap, and then a block that is large enough.
        recovery.add_to_open_block(message_block(300, TARGET_BLOCK_BYTES, 9));
        recovery.add_to_open_block(message_block(300 + TARGET_BLOCK_BYTES, 10, 8));
        recovery.close_block();
        recovery.close_block();
        let blocks: Vec<_> =
            recovery.index.blocks.iter().map(|b| (b.at, b.length, b.start, b.end)).collect();
        let end = 300 + TARGET_BLOCK_BYTES;
        let expected = [(100, 100, 3, 7), (300, TARGET_BLOCK_BYTES, 9, 9), (end, 10, 8, 8)];
        assert_eq!(blocks, expected);
    }

    #[test]
    fn the_index_of_a_finished_bag_is_the_same_from_its_end_and_from_its_records() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut bag = BagWriter::create(&path).unwrap();
        for (topic, second) in [("/a", 3), ("/b", 1), ("/a", 2)] {
            let stamp = Stamp::new(second, 0);
            let bytes = cdr::to_bytes(&Clock { clock: stamp.into() }).unwrap();
            bag.write(topic, Clock::TYPE_NAME, &bytes, stamp, stamp).unwrap();
            bag.flush().unwrap();
        }
        bag.write_metadata("notes", &BTreeMap::from([("a".into(), "b".into())])).unwrap();
        bag.finish().unwrap();
        let mut file = File::open(&path).unwrap();
        let size = file.metadata().unwrap().len();
        let summary = index_summary::index(&mut file, &path, size).unwrap();
        let recovered = index(&mut file, &path, size).unwrap();
        assert_eq!(recovered.topics, summary.topics);
        assert_eq!(recovered.metadata, summary.metadata);
        assert!(recovered.damage.is_empty(), "{:?}", recovered.damage);
        let mut spans = [&recovered, &summary].map(|index| {
            let blocks = index.blocks.iter().filter(|block| block.end > 0);
            blocks.map(|b| (b.at, b.length, b.start, b.end)).collect::<Vec<_>>()
        });
        spans.iter_mut().for_each(|spans| spans.sort_unstable());
        assert_eq!(spans[0].len(), 3);
        assert_eq!(spans[0], spans[1]);
    }

    #[test]
    fn a_file_without_its_end_has_no_summary() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        BagWriter::create(&path).unwrap().finish().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 20]).unwrap();
        let mut file = File::open(&path).unwrap();
        let size = bytes.len() as u64 - 20;
        assert!(index_summary::index(&mut file, &path, size).is_none());
        let recovered = index(&mut file, &path, size).unwrap();
        assert!(recovered.topics.is_empty());
        assert_eq!(recovered.metadata[0].0, "rosbag2");
    }
}
