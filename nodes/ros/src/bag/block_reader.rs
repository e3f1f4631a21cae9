//! Reads a block of a file and the records in it.

use super::bag_error::BagError;
use super::file_index::Block;
use mcap::McapResult;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Length of the header of a record: one byte opcode, eight bytes length.
pub(crate) const RECORD_HEADER_BYTES: u64 = 9;
/// A longer record is taken for damage: no cloud or mesh of the project comes near this length.
pub(crate) const MAX_RECORD_BYTES: u64 = 1 << 31;

/// Reads the bytes of a block.
pub(crate) fn read(file: &mut File, path: &Path, block: &Block) -> Result<Vec<u8>, BagError> {
    if block.length > MAX_RECORD_BYTES {
        let reason = format!("a piece of {} bytes", block.length);
        return Err(BagError::Damaged { path: path.to_owned(), at: block.at, reason });
    }
    file.seek(SeekFrom::Start(block.at)).map_err(BagError::io(path, "read"))?;
    let mut bytes = vec![0; block.length as usize];
    file.read_exact(&mut bytes).map_err(BagError::io(path, "read a chunk"))?;
    Ok(bytes)
}

/// Calls `see` with the schemas, channels and messages in `bytes`, which hold whole records. Chunks
/// are unpacked and their checksums checked.
pub(crate) fn records(
    mut bytes: &[u8],
    mut see: impl FnMut(Record<'_>) -> McapResult<()>,
) -> McapResult<()> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(MAX_RECORD_BYTES as usize);
    let mut reader = LinearReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(wanted) => {
                let (requested, rest) = bytes.split_at(bytes.len().min(wanted));
                reader.insert(requested.len()).copy_from_slice(requested);
                reader.notify_read(requested.len());
                bytes = rest;
            }
            LinearReadEvent::Record {
                data,
                opcode: opcode @ (op::SCHEMA | op::CHANNEL | op::MESSAGE),
            } => {
                see(mcap::parse_record(opcode, data)?)?;
            }
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(())
}
