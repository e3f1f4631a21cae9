//! The readers and writers of a participant.

use super::discovery_graph::DiscoveryGraph;
use super::matched_endpoints::MatchedEndpoints;
use super::serialized_payload::{PayloadAdapter, ReceivedSample, SerializedPayload};
use futures::StreamExt;
use rustdds::no_key::{DataWriter, SimpleDataReader};
use rustdds::{GUID, RepresentationIdentifier, SampleIdentity, Timestamp, WriteOptionsBuilder};
use std::sync::Arc;

/// What readers and writers have in common. Dropping it takes the endpoint out of the discovery
/// graph.
pub(super) struct Endpoint {
    pub(super) guid: GUID,
    pub(super) matches: Arc<MatchedEndpoints>,
    pub(super) graph: Arc<DiscoveryGraph>,
}

impl Drop for Endpoint {
    fn drop(&mut self) {
        self.graph.remove(self.guid);
        self.matches.remove_local(self.guid);
    }
}

/// Writes serialized samples to a topic.
pub(crate) struct Writer {
    pub(super) inner: DataWriter<SerializedPayload, PayloadAdapter>,
    pub(super) endpoint: Endpoint,
}

impl Writer {
    /// Writes a sample in little-endian CDR without encapsulation header; `related` is the related
    /// sample identity of its inline QoS. Returns the identity of the sample.
    ///
    /// # Errors
    /// In words, if a reliable reader does not keep up.
    pub fn write(
        &self,
        body: Vec<u8>,
        related: Option<SampleIdentity>,
    ) -> Result<SampleIdentity, String> {
        let raw =
            SerializedPayload { body: body.into(), encoding: RepresentationIdentifier::CDR_LE };
        let options = WriteOptionsBuilder::new()
            .source_timestamp(Timestamp::now())
            .related_sample_identity_opt(related)
            .build();
        self.inner.write_with_options(raw, options).map_err(|error| match error {
            rustdds::dds::result::WriteError::WouldBlock { .. } => {
                "the queue stayed full for 100 ms: a reader does not keep up; the sample is dropped"
                    .to_owned()
            }
            other => other.to_string(),
        })
    }

    pub fn guid(&self) -> GUID {
        self.endpoint.guid
    }

    pub fn matches(&self) -> &MatchedEndpoints {
        &self.endpoint.matches
    }
}

/// Reads serialized samples from a topic.
pub(crate) struct Reader {
    pub(super) inner: SimpleDataReader<SerializedPayload, PayloadAdapter>,
    pub(super) endpoint: Endpoint,
}

impl Reader {
    /// The next sample.
    ///
    /// # Errors
    /// Those of the transport, in words.
    pub async fn next(&self) -> Result<ReceivedSample, String> {
        let mut stream = std::pin::pin!(self.inner.as_async_stream());
        match stream.next().await {
            Some(Ok(change)) => Ok(received_sample(change)),
            Some(Err(error)) => Err(error.to_string()),
            None => std::future::pending().await,
        }
    }

    /// The next sample if it has arrived already.
    ///
    /// # Errors
    /// Those of the transport, in words.
    pub fn try_next(&self) -> Result<Option<ReceivedSample>, String> {
        self.inner.drain_read_notifications();
        self.inner.try_take_one().map(|taken| taken.map(received_sample)).map_err(|e| e.to_string())
    }

    pub fn guid(&self) -> GUID {
        self.endpoint.guid
    }

    pub fn matches(&self) -> &MatchedEndpoints {
        &self.endpoint.matches
    }
}

fn received_sample(
    change: rustdds::no_key::DeserializedCacheChange<SerializedPayload>,
) -> ReceivedSample {
    ReceivedSample {
        identity: SampleIdentity {
            writer_guid: change.writer_guid(),
            sequence_number: change.sequence_number,
        },
        related: change.related_sample_identity(),
        payload: change.into_value(),
    }
}
