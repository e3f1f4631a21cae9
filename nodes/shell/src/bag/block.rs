//! Reading a piece of a file.

use super::error::BagError;
use super::index::Block;
use mcap::McapResult;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Records above this are taken for damage, bytes: no cloud or mesh of the project comes near it.
pub(crate) const LARGEST_RECORD: u64 = 1 << 31;

/// The bytes of a block.
pub(crate) fn read(file: &mut File, path: &Path, block: &Block) -> Result<Vec<u8>, BagError> {
    if block.length > LARGEST_RECORD {
        let reason = format!("a piece of {} bytes", block.length);
        return Err(BagError::Damaged { path: path.to_owned(), at: block.at, reason });
    }
    file.seek(SeekFrom::Start(block.at)).map_err(BagError::io(path, "read"))?;
    let mut bytes = vec![0; block.length as usize];
    file.read_exact(&mut bytes).map_err(BagError::io(path, "read a chunk"))?;
    Ok(bytes)
}

/// Shows the schemas, channels and messages in the bytes of whole records, chunks unpacked and checked.
pub(crate) fn records(
    mut bytes: &[u8],
    mut see: impl FnMut(Record<'_>) -> McapResult<()>,
) -> McapResult<()> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(LARGEST_RECORD as usize);
    let mut reader = LinearReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = bytes.split_at(bytes.len().min(wanted));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                bytes = later;
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
