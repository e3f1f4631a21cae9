//! Writing a bag.

use super::error::BagError;
use super::info::BagTopic;
use super::{qos, rosbag2};
use crate::{Profile, Stamp};
use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Messages that make a chunk, bytes: little is lost when a recording is cut off, and chunks are large enough to compress
/// well. A larger message is a chunk of its own.
const CHUNK: usize = 2 << 20;

/// Writes a bag, an `.mcap` file. Dropping it closes the file without the notes of rosbag2: see [`BagWriter::finish`].
pub struct BagWriter {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    topics: Vec<BagTopic>,
    /// Channel of each topic and its place in `topics`.
    channels: BTreeMap<String, (u16, usize)>,
    range: Option<(Stamp, Stamp)>,
    /// Bytes in the open chunk.
    open: usize,
}

impl BagWriter {
    /// Makes the file, and the folders above it.
    ///
    /// # Errors
    /// [`BagError::Io`], also if the file exists.
    pub fn create(path: impl AsRef<Path>) -> Result<BagWriter, BagError> {
        let path = path.as_ref();
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(BagError::io(folder, "make the folder"))?;
        }
        let file = File::create_new(path).map_err(BagError::io(path, "create the file"))?;
        let options = WriteOptions::new()
            .profile("ros2")
            .library(concat!("puffer ", env!("CARGO_PKG_VERSION")))
            .chunk_size(None)
            // A chunk is written when it is whole, and the same in every run.
            .disable_seeking(true)
            .compression_threads(0);
        let writer = options
            .create(BufWriter::new(file))
            .map_err(|error| refused(path, "write the header", error))?;
        Ok(BagWriter {
            path: path.to_owned(),
            writer,
            topics: Vec::new(),
            channels: BTreeMap::new(),
            range: None,
            open: 0,
        })
    }

    /// Announces a topic and the profile with which it is published. Topics that are written without it are
    /// [`Profile::Standard`], `/tf_static` is [`Profile::Latched`].
    ///
    /// # Errors
    /// [`BagError::Topic`] if the type is unknown, or the topic has another type already; [`BagError::Io`].
    pub fn add_topic(
        &mut self,
        topic: &str,
        type_name: &str,
        profile: Profile,
    ) -> Result<(), BagError> {
        self.channel(topic, type_name, Some(profile)).map(|_| ())
    }

    /// Adds a message: serialized, with its encapsulation header.
    ///
    /// # Errors
    /// [`BagError::Topic`] if the type is unknown, the topic has another type, the bytes are no CDR or a time lies before
    /// 1970; [`BagError::Io`].
    pub fn write(
        &mut self,
        topic: &str,
        type_name: &str,
        bytes: &[u8],
        log_time: Stamp,
        publish_time: Stamp,
    ) -> Result<(), BagError> {
        let (channel_id, place) = self.channel(topic, type_name, None)?;
        if !matches!(bytes, [0, 0 | 1, _, _, ..]) {
            let start = &bytes[..bytes.len().min(4)];
            return Err(self.wrong(topic, format!("no CDR message: it begins with {start:02x?}")));
        }
        let time = |time: Stamp| {
            let negative = || self.wrong(topic, format!("a message at {time}, before 1970"));
            u64::try_from(time.nanos()).map_err(|_| negative())
        };
        let header = MessageHeader {
            channel_id,
            sequence: self.topics[place].count as u32,
            log_time: time(log_time)?,
            publish_time: time(publish_time)?,
        };
        if self.open > 0 && self.open + bytes.len() > CHUNK {
            self.flush()?;
        }
        self.writer
            .write_to_known_channel(&header, bytes)
            .map_err(|error| refused(&self.path, "write a message", error))?;
        self.topics[place].count += 1;
        let (start, end) = self.range.unwrap_or((log_time, log_time));
        self.range = Some((start.min(log_time), end.max(log_time)));
        self.open += bytes.len();
        Ok(())
    }

    /// Closes the open chunk and gives it to the system: what was written so far is safe when the process dies.
    ///
    /// # Errors
    /// [`BagError::Io`].
    pub fn flush(&mut self) -> Result<(), BagError> {
        self.open = 0;
        self.writer.flush().map_err(|error| refused(&self.path, "write", error))
    }

    /// Adds named notes, such as the parameters of a run.
    ///
    /// # Errors
    /// [`BagError::Io`].
    pub fn write_metadata(
        &mut self,
        name: &str,
        values: &BTreeMap<String, String>,
    ) -> Result<(), BagError> {
        self.open = 0;
        let metadata = Metadata { name: name.to_owned(), metadata: values.clone() };
        self.writer
            .write_metadata(&metadata)
            .map_err(|error| refused(&self.path, "write metadata", error))
    }

    /// Closes the bag: the index that makes opening quick, and rosbag2's notes.
    ///
    /// # Errors
    /// [`BagError::Io`].
    pub fn finish(mut self) -> Result<(), BagError> {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let text = rosbag2::serialized_metadata(&name, &self.topics, self.range).map_err(|e| {
            refused(&self.path, "note the topics", McapError::Io(std::io::Error::other(e)))
        })?;
        self.write_metadata("rosbag2", &BTreeMap::from([("serialized_metadata".into(), text)]))?;
        self.writer.finish().map_err(|error| refused(&self.path, "write the index", error))?;
        let file = self.writer.into_inner();
        let file = file.into_inner().map_err(|e| BagError::Io {
            path: self.path.clone(),
            doing: "write the end",
            source: e.into_error(),
        })?;
        file.sync_all().map_err(BagError::io(&self.path, "write to the disk"))
    }

    /// Channel of a topic, and the topic's place in the list.
    fn channel(
        &mut self,
        topic: &str,
        type_name: &str,
        profile: Option<Profile>,
    ) -> Result<(u16, usize), BagError> {
        if let Some(&(channel, place)) = self.channels.get(topic) {
            let known = &*self.topics[place].type_name;
            if known != type_name {
                let reason = format!("it is a {known} already, and now a {type_name}");
                return Err(self.wrong(topic, reason));
            }
            return Ok((channel, place));
        }
        let definitions = puffer_msgs::definitions();
        let place =
            definitions.binary_search_by(|(name, _)| (*name).cmp(type_name)).map_err(|_| {
                self.wrong(topic, format!("type {type_name} is none of the interfaces of puffer"))
            })?;
        let offered = qos::offered(profile.unwrap_or_else(|| qos::default_profile(topic)))
            .map_err(|e| self.wrong(topic, e))?;
        let metadata = BTreeMap::from([("offered_qos_profiles".to_owned(), offered.clone())]);
        let write = |error| refused(&self.path, "write the topic", error);
        let text = definitions[place].1.as_bytes();
        let schema = self.writer.add_schema(type_name, "ros2msg", text).map_err(write)?;
        let channel = self.writer.add_channel(schema, topic, "cdr", &metadata).map_err(write)?;
        let entry = (channel, self.topics.len());
        self.channels.insert(topic.to_owned(), entry);
        self.topics.push(BagTopic {
            name: topic.into(),
            type_name: type_name.into(),
            encoding: "cdr".into(),
            offered_qos: offered,
            count: 0,
        });
        Ok(entry)
    }

    fn wrong(&self, topic: &str, reason: String) -> BagError {
        BagError::Topic { path: self.path.clone(), topic: topic.to_owned(), reason }
    }
}

fn refused(path: &Path, doing: &'static str, error: McapError) -> BagError {
    let source = match error {
        McapError::Io(source) => source,
        other => std::io::Error::other(other),
    };
    BagError::Io { path: path.to_owned(), doing, source }
}
