//! The index of a file without one, from all of its records: of recordings that were cut off, or written without.

use super::block::{self, LARGEST_RECORD};
use super::error::BagError;
use super::index::{Block, Index, topic};
use mcap::McapResult;
use mcap::read::ChannelAccumulator;
use mcap::records::{Record, op};
use std::fs::File;
use std::io::{Seek, SeekFrom};
use std::path::Path;

/// Opcode and length of a record.
const HEADER: u64 = 9;
/// Messages without a chunk are put together into pieces of about this size, bytes.
const PIECE: u64 = 1 << 20;

/// Reads the whole file, `size` bytes, and keeps what can be read of it.
pub(crate) fn index(file: &mut File, path: &Path, size: u64) -> Result<Index, BagError> {
    let index = Index { path: path.to_owned(), ..Index::default() };
    let mut scan = Scan { index, channels: ChannelAccumulator::default(), piece: None };
    let mut at = mcap::MAGIC.len() as u64;
    loop {
        if at + HEADER > size {
            scan.ends_early(at, "the end of the file is missing");
            break;
        }
        let header = block::read(file, path, &piece(at, HEADER))?;
        let opcode = header[0];
        let length = HEADER.saturating_add(u64_of(&header[1..]));
        if matches!(opcode, op::DATA_END | op::FOOTER) {
            break;
        }
        if length > LARGEST_RECORD || opcode == 0 {
            scan.ends_early(at, "what follows is no MCAP");
            break;
        }
        if at + length > size {
            scan.ends_early(at, "the file ends in the middle of a record");
            break;
        }
        if matches!(opcode, op::CHUNK | op::MESSAGE | op::SCHEMA | op::CHANNEL | op::METADATA) {
            let bytes = block::read(file, path, &piece(at, length))?;
            scan.take(opcode, at, &bytes);
        }
        at += length;
    }
    scan.close_piece();
    file.seek(SeekFrom::Start(0)).map_err(BagError::io(path, "read"))?;
    Ok(scan.index)
}

fn piece(at: u64, length: u64) -> Block {
    Block { at, length, start: u64::MAX, end: 0 }
}

fn u64_of(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

struct Scan {
    index: Index,
    channels: ChannelAccumulator<'static>,
    /// Messages without a chunk, so far.
    piece: Option<Block>,
}

impl Scan {
    fn take(&mut self, opcode: u8, at: u64, bytes: &[u8]) {
        if opcode == op::METADATA {
            match mcap::parse_record(opcode, &bytes[HEADER as usize..]) {
                Ok(Record::Metadata(notes)) => {
                    self.index.metadata.push((notes.name, notes.metadata));
                }
                _ => self.damaged(at, "unreadable metadata"),
            }
            return;
        }
        let mut block = piece(at, bytes.len() as u64);
        let mut counts = Vec::new();
        let (index, channels) = (&mut self.index, &mut self.channels);
        let read =
            block::records(bytes, |record| see(record, index, channels, &mut block, &mut counts));
        if let Err(error) = read {
            self.damaged(at, &error.to_string());
            return;
        }
        for topic in &counts {
            self.index.topics.entry(*topic).and_modify(|topic| topic.count += 1);
        }
        if opcode == op::CHUNK {
            self.close_piece();
            self.index.blocks.push(block);
        } else if opcode == op::MESSAGE {
            self.add_to_piece(block);
        }
    }

    fn add_to_piece(&mut self, block: Block) {
        match &mut self.piece {
            Some(piece) if piece.at + piece.length == block.at && piece.length < PIECE => {
                piece.length += block.length;
                piece.start = piece.start.min(block.start);
                piece.end = piece.end.max(block.end);
            }
            _ => {
                self.close_piece();
                self.piece = Some(block);
            }
        }
    }

    fn close_piece(&mut self) {
        self.index.blocks.extend(self.piece.take());
    }

    fn damaged(&mut self, at: u64, reason: &str) {
        self.index.damage.push(format!("byte {at}: {reason}; this piece is left out"));
    }

    fn ends_early(&mut self, at: u64, reason: &str) {
        let count: u64 = self.index.topics.values().map(|topic| topic.count).sum();
        let count = format!("{count} messages before it can be read");
        self.index
            .damage
            .push(format!("byte {at}: {reason} (was the recording cut off?); {count}"));
    }
}

fn see(
    record: Record<'_>,
    index: &mut Index,
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
                index.topics.entry(id).or_insert_with(|| topic(&channel));
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
