//! Opens a bag.

use super::bag_error::BagError;
use super::bag_info::{BagInfo, BagTopic};
use super::file_index::{Block, FileIndex};
use super::message_iterator::{Messages, stamp_from_log_time};
use super::{bag_folder, index_recovery, index_summary};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Number of bytes at the start of a file that tell its format.
const FORMAT_MAGIC_BYTES: u64 = 16;

/// Reads a bag: an `.mcap` file, or a rosbag2 folder of such files. See [`bag`](crate::bag) for an
/// example.
#[derive(Debug)]
pub struct BagReader {
    files: Vec<FileIndex>,
}

impl BagReader {
    /// Opens the bag. A file without index, as of a recording that was cut off, is read once as a
    /// whole; what of it is lost stands in [`BagInfo::damage`].
    ///
    /// # Errors
    /// [`BagError::NotABag`] if the path is something else, saying what; [`BagError::Io`] if it
    /// cannot be read.
    pub fn open(path: impl AsRef<Path>) -> Result<BagReader, BagError> {
        let files = bag_folder::files(path.as_ref())?;
        Ok(BagReader {
            files: files.iter().map(|file| index_file(file)).collect::<Result<_, _>>()?,
        })
    }

    /// An overview of the bag.
    pub fn info(&self) -> BagInfo {
        let mut info = BagInfo::default();
        let mut topics: BTreeMap<(&str, &str), BagTopic> = BTreeMap::new();
        for topic in self.files.iter().flat_map(|file| file.topics.values()) {
            topics
                .entry((&topic.name, &topic.type_name))
                .and_modify(|known| known.count += topic.count)
                .or_insert_with(|| topic.clone());
        }
        info.topics = topics.into_values().collect();
        info.count = info.topics.iter().map(|topic| topic.count).sum();
        if info.count > 0 {
            let starts = self.dated_blocks().map(|block| block.start);
            let ends = self.dated_blocks().map(|block| block.end);
            info.start = stamp_from_log_time(starts.min().unwrap_or_default());
            info.end = stamp_from_log_time(ends.max().unwrap_or_default());
        }
        for file in &self.files {
            let name = file.path.file_name().unwrap_or_default().to_string_lossy();
            info.damage.extend(file.damage.iter().map(|damage| format!("{name}: {damage}")));
        }
        info
    }

    /// The blocks that hold messages: a chunk that announces topics only has the times 0 and 0.
    fn dated_blocks(&self) -> impl Iterator<Item = &Block> {
        let blocks = self.files.iter().flat_map(|file| &file.blocks);
        blocks.filter(|block| block.start <= block.end && block.end > 0)
    }

    /// The messages of the named topics, or of all if none is named, in the order of their log
    /// times.
    ///
    /// # Errors
    /// [`BagError::Io`] if a file cannot be opened again.
    pub fn messages(&self, topics: &[&str]) -> Result<Messages, BagError> {
        Messages::new(&self.files, topics)
    }

    /// The metadata of this name. Several records of the name are merged; later values win.
    pub fn metadata(&self, name: &str) -> Option<BTreeMap<String, String>> {
        let records = self.files.iter().flat_map(|file| &file.metadata);
        let mut found = records.filter(|(other, _)| other == name).map(|(_, notes)| notes.clone());
        let first = found.next()?;
        Some(found.fold(first, |mut all, later| {
            all.extend(later);
            all
        }))
    }
}

/// The index of a file, from its end if it has one there, else from all of its records.
fn index_file(path: &Path) -> Result<FileIndex, BagError> {
    let mut file = File::open(path).map_err(BagError::io(path, "open"))?;
    let size = file.metadata().map_err(BagError::io(path, "read"))?.len();
    let mut start = Vec::new();
    Read::by_ref(&mut file)
        .take(FORMAT_MAGIC_BYTES)
        .read_to_end(&mut start)
        .map_err(BagError::io(path, "read"))?;
    if !start.starts_with(mcap::MAGIC) {
        return Err(bag_folder::wrong_format_error(path, &start));
    }
    match index_summary::index(&mut file, path, size) {
        Some(index) => Ok(index),
        None => index_recovery::index(&mut file, path, size),
    }
}
