//! Reads the index of a file that was finished from the summary at its end.

use super::block_reader::{self, RECORD_HEADER_BYTES};
use super::file_index::{Block, FileIndex, topic_from_channel};
use mcap::records::Record;
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};
use mcap::{McapResult, Summary};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// The index, or `None` where the file does not end with a complete summary and has to be read as a
/// whole.
pub(crate) fn index(file: &mut File, path: &Path, size: u64) -> Option<FileIndex> {
    let summary = read(file, size).ok()??;
    let stats = summary.stats.as_ref()?;
    let is_complete = stats.chunk_count as usize == summary.chunk_indexes.len()
        && stats.metadata_count as usize == summary.metadata_indexes.len()
        && stats.channel_count as usize == summary.channels.len()
        && (stats.message_count == 0 || stats.chunk_count > 0);
    if !is_complete {
        return None;
    }
    let mut index = FileIndex { path: path.to_owned(), ..FileIndex::default() };
    for (id, channel) in &summary.channels {
        let count = stats.channel_message_counts.get(id).copied().unwrap_or_default();
        let mut topic = topic_from_channel(channel);
        topic.count = count;
        index.topics.insert(*id, topic);
    }
    for chunk in &summary.chunk_indexes {
        let (start, end) = (chunk.message_start_time, chunk.message_end_time);
        let (at, length) = (chunk.chunk_start_offset, chunk.chunk_length);
        if at.checked_add(length)? > size {
            return None;
        }
        index.blocks.push(Block { at, length, start, end });
    }
    for entry in &summary.metadata_indexes {
        let block = Block { at: entry.offset, length: entry.length, start: 0, end: 0 };
        let bytes = block_reader::read(file, path, &block).ok()?;
        let Record::Metadata(metadata) =
            mcap::parse_record(*bytes.first()?, bytes.get(RECORD_HEADER_BYTES as usize..)?).ok()?
        else {
            return None;
        };
        index.metadata.push((metadata.name, metadata.metadata));
    }
    Some(index)
}

fn read(file: &mut File, size: u64) -> McapResult<Option<Summary>> {
    file.seek(SeekFrom::Start(0))?;
    let options = SummaryReaderOptions::default().with_file_size(size);
    let mut reader = SummaryReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event? {
            SummaryReadEvent::ReadRequest(wanted) => {
                let got = file.read(reader.insert(wanted))?;
                reader.notify_read(got);
            }
            SummaryReadEvent::SeekRequest(to) => reader.notify_seeked(file.seek(to)?),
        }
    }
    Ok(reader.finish())
}
