//! Writes a bag.

use super::bag_error::BagError;
use super::bag_info::BagTopic;
use super::{offered_qos, rosbag2_metadata};
use crate::{QosProfile, Stamp};
use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Size of the messages that make a chunk: little is lost when a recording is cut off, and chunks
/// are large enough to compress well. A larger message is a chunk of its own.
const MAX_CHUNK_BYTES: usize = 2 << 20;

/// Writes a bag, an `.mcap` file. See [`bag`](crate::bag) for an example. Dropping it closes the
/// file without the metadata of rosbag2: see [`BagWriter::finish`].
pub struct BagWriter {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    topics: Vec<BagTopic>,
    /// The channel of each topic, and the topic's position in `topics`.
    channels: BTreeMap<String, (u16, usize)>,
    /// Earliest and latest log time.
    range: Option<(Stamp, Stamp)>,
    /// Size of the messages in the open chunk, bytes.
    open_chunk_bytes: usize,
}

impl BagWriter {
    /// Creates the file, and the folders above it.
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
            // A chunk is written when it is complete, and is the same in every run.
            .disable_seeking(true)
            .compression_threads(0);
        let writer = options
            .create(BufWriter::new(file))
            .map_err(|error| io_error(path, "write the header", error))?;
        Ok(BagWriter {
            path: path.to_owned(),
            writer,
            topics: Vec::new(),
            channels: BTreeMap::new(),
            range: None,
            open_chunk_bytes: 0,
        })
    }

    /// Announces a topic and the QoS profile with which it is published. A topic that is written
    /// without being announced has [`QosProfile::Standard`], and `/tf_static`
    /// [`QosProfile::Latched`].
    ///
    /// # Errors
    /// [`BagError::Topic`] if the type is unknown, or the topic has another type already;
    /// [`BagError::Io`].
    pub fn add_topic(
        &mut self,
        topic: &str,
        type_name: &str,
        profile: QosProfile,
    ) -> Result<(), BagError> {
        self.channel(topic, type_name, Some(profile)).map(|_| ())
    }

    /// Adds a serialized message with its encapsulation header.
    ///
    /// # Errors
    /// [`BagError::Topic`] if the type is unknown, the topic has another type, the bytes are no CDR
    /// or a time lies before 1970; [`BagError::Io`].
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
            return Err(
                self.topic_error(topic, format!("no CDR message: it begins with {start:02x?}"))
            );
        }
        let header = MessageHeader {
            channel_id,
            sequence: self.topics[place].count as u32,
            log_time: self.mcap_time(topic, log_time)?,
            publish_time: self.mcap_time(topic, publish_time)?,
        };
        if self.open_chunk_bytes > 0 && self.open_chunk_bytes + bytes.len() > MAX_CHUNK_BYTES {
            self.flush()?;
        }
        self.writer
            .write_to_known_channel(&header, bytes)
            .map_err(|error| io_error(&self.path, "write a message", error))?;
        self.topics[place].count += 1;
        let (start, end) = self.range.unwrap_or((log_time, log_time));
        self.range = Some((start.min(log_time), end.max(log_time)));
        self.open_chunk_bytes += bytes.len();
        Ok(())
    }

    /// Closes the open chunk and gives it to the operating system: what was written so far is safe
    /// when the process dies.
    ///
    /// # Errors
    /// [`BagError::Io`].
    pub fn flush(&mut self) -> Result<(), BagError> {
        self.open_chunk_bytes = 0;
        self.writer.flush().map_err(|error| io_error(&self.path, "write", error))
    }

    /// Adds a metadata record, such as the parameters of a run.
    ///
    /// # Errors
    /// [`BagError::Io`].
    pub fn write_metadata(
        &mut self,
        name: &str,
        values: &BTreeMap<String, String>,
    ) -> Result<(), BagError> {
        self.open_chunk_bytes = 0;
        let metadata = Metadata { name: name.to_owned(), metadata: values.clone() };
        self.writer
            .write_metadata(&metadata)
            .map_err(|error| io_error(&self.path, "write metadata", error))
    }

    /// Completes the bag with the metadata of rosbag2 and the index that makes opening quick.
    ///
    /// # Errors
    /// [`BagError::Io`].
    pub fn finish(mut self) -> Result<(), BagError> {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let text = rosbag2_metadata::serialized_metadata(&name, &self.topics, self.range).map_err(
            |e| io_error(&self.path, "note the topics", McapError::Io(std::io::Error::other(e))),
        )?;
        self.write_metadata("rosbag2", &BTreeMap::from([("serialized_metadata".into(), text)]))?;
        self.writer.finish().map_err(|error| io_error(&self.path, "write the index", error))?;
        let file = self.writer.into_inner();
        let file = file.into_inner().map_err(|e| BagError::Io {
            path: self.path.clone(),
            doing: "write the end",
            source: e.into_error(),
        })?;
        file.sync_all().map_err(BagError::io(&self.path, "write to the disk"))
    }

    /// The channel of a topic, which is announced if need be, and the topic's position in `topics`.
    fn channel(
        &mut self,
        topic: &str,
        type_name: &str,
        profile: Option<QosProfile>,
    ) -> Result<(u16, usize), BagError> {
        if let Some(&(channel, place)) = self.channels.get(topic) {
            let known = &*self.topics[place].type_name;
            if known != type_name {
                let reason = format!("it is a {known} already, and now a {type_name}");
                return Err(self.topic_error(topic, reason));
            }
            return Ok((channel, place));
        }
        let definitions = puffer_msgs::definitions();
        let place =
            definitions.binary_search_by(|(name, _)| (*name).cmp(type_name)).map_err(|_| {
                self.topic_error(
                    topic,
                    format!("type {type_name} is none of the interfaces of puffer"),
                )
            })?;
        let offered =
            offered_qos::to_yaml(profile.unwrap_or_else(|| offered_qos::default_profile(topic)))
                .map_err(|e| self.topic_error(topic, e))?;
        let metadata = BTreeMap::from([("offered_qos_profiles".to_owned(), offered.clone())]);
        let text = definitions[place].1.as_bytes();
        let schema = self
            .writer
            .add_schema(type_name, "ros2msg", text)
            .map_err(|error| io_error(&self.path, "write the topic", error))?;
        let channel = self
            .writer
            .add_channel(schema, topic, "cdr", &metadata)
            .map_err(|error| io_error(&self.path, "write the topic", error))?;
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

    /// A stamp as a time of MCAP.
    fn mcap_time(&self, topic: &str, stamp: Stamp) -> Result<u64, BagError> {
        u64::try_from(stamp.nanos())
            .map_err(|_| self.topic_error(topic, format!("a message at {stamp}, before 1970")))
    }

    fn topic_error(&self, topic: &str, reason: String) -> BagError {
        BagError::Topic { path: self.path.clone(), topic: topic.to_owned(), reason }
    }
}

fn io_error(path: &Path, doing: &'static str, error: McapError) -> BagError {
    let source = match error {
        McapError::Io(source) => source,
        other => std::io::Error::other(other),
    };
    BagError::Io { path: path.to_owned(), doing, source }
}
