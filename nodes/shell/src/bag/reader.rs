//! Opening a bag.

use super::error::BagError;
use super::index::{Block, Index};
use super::info::{BagInfo, BagTopic};
use super::messages::{Messages, stamp};
use super::{folder, scan, summary};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Reads a bag: an `.mcap` file, or a rosbag2 folder of them.
#[derive(Debug)]
pub struct BagReader {
    files: Vec<Index>,
}

impl BagReader {
    /// Opens the bag. A file without index, as of a recording that was cut off, is read once in whole; what of it is lost
    /// stands in [`BagInfo::damage`].
    ///
    /// # Errors
    /// [`BagError::NoBag`] tells what the path is instead, [`BagError::Io`] that it cannot be read.
    pub fn open(path: impl AsRef<Path>) -> Result<BagReader, BagError> {
        let files = folder::files(path.as_ref())?;
        Ok(BagReader { files: files.iter().map(|file| index(file)).collect::<Result<_, _>>()? })
    }

    /// What is in the bag.
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
        // A chunk that announces topics and holds no message has the times 0 and 0.
        let dated = |b: &&Block| b.start <= b.end && b.end > 0;
        let blocks = || self.files.iter().flat_map(|file| &file.blocks).filter(dated);
        if info.count > 0 {
            info.start = stamp(blocks().map(|block| block.start).min().unwrap_or_default());
            info.end = stamp(blocks().map(|block| block.end).max().unwrap_or_default());
        }
        for file in &self.files {
            let name = file.path.file_name().unwrap_or_default().to_string_lossy();
            info.damage.extend(file.damage.iter().map(|damage| format!("{name}: {damage}")));
        }
        info
    }

    /// The messages of the topics named (all, if none is named) in the order of time.
    ///
    /// # Errors
    /// [`BagError::Io`] if a file cannot be opened again.
    pub fn messages(&self, topics: &[&str]) -> Result<Messages, BagError> {
        Messages::new(&self.files, topics)
    }

    /// Notes of this name; those of several records are put together, and the later ones count.
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

fn index(path: &Path) -> Result<Index, BagError> {
    let mut file = File::open(path).map_err(BagError::io(path, "open"))?;
    let size = file.metadata().map_err(BagError::io(path, "read"))?.len();
    let mut start = Vec::new();
    let length = 16;
    Read::by_ref(&mut file)
        .take(length)
        .read_to_end(&mut start)
        .map_err(BagError::io(path, "read"))?;
    if !start.starts_with(mcap::MAGIC) {
        return Err(folder::wrong_file(path, &start));
    }
    match summary::index(&mut file, path, size) {
        Some(index) => Ok(index),
        None => scan::index(&mut file, path, size),
    }
}
