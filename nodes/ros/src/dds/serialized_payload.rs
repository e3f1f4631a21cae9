//! Samples as serialized bytes: rustdds passes them through, so that bags and tiles can carry them
//! unread, and services can put a header in front.

use bytes::{BufMut, Bytes, BytesMut};
use rustdds::{GUID, RepresentationIdentifier, SampleIdentity, no_key};
use serde::{Serialize, de::DeserializeOwned};
use std::convert::Infallible;

/// Length of the encapsulation header: representation identifier and options, two bytes each.
const ENCAPSULATION_BYTES: usize = 4;

/// The serialized bytes of a sample, without the encapsulation header, and their encoding.
#[derive(Clone, Debug)]
pub(crate) struct SerializedPayload {
    pub body: Bytes,
    pub encoding: RepresentationIdentifier,
}

/// A sample that has come in.
#[derive(Clone, Debug)]
pub(crate) struct ReceivedSample {
    pub payload: SerializedPayload,
    /// The GUID of its writer, and its sequence number.
    pub identity: SampleIdentity,
    /// The related sample identity of its inline QoS.
    pub related: Option<SampleIdentity>,
}

impl ReceivedSample {
    pub fn writer(&self) -> GUID {
        self.identity.writer_guid
    }
}

impl SerializedPayload {
    /// The payload of a serialized message in little-endian CDR with its encapsulation header, as
    /// bags store it and tiles carry it.
    pub fn from_message(message: &Bytes) -> SerializedPayload {
        let body = message.slice(ENCAPSULATION_BYTES.min(message.len())..);
        SerializedPayload { body, encoding: RepresentationIdentifier::CDR_LE }
    }

    /// The serialized message with its encapsulation header.
    pub fn to_message(&self) -> Bytes {
        let mut bytes = BytesMut::with_capacity(ENCAPSULATION_BYTES + self.body.len());
        bytes.put_slice(&self.encoding.to_bytes());
        bytes.put_slice(&[0, 0]);
        bytes.put_slice(&self.body);
        bytes.freeze()
    }

    /// The message.
    ///
    /// # Errors
    /// In words, if the bytes do not hold a message of this type.
    pub fn decode<M: DeserializeOwned>(&self) -> Result<M, String> {
        rustdds::serialization::deserialize_from_cdr_with_rep_id(&self.body, self.encoding)
            .map(|(message, _)| message)
            .map_err(|error| {
                format!(
                    "{} bytes do not hold a {}: {error}",
                    self.body.len(),
                    short_type_name::<M>()
                )
            })
    }
}

/// The message as little-endian CDR, without encapsulation header.
///
/// # Errors
/// In words, if the message cannot be serialized.
pub(crate) fn encode<M: Serialize>(message: &M) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::with_capacity(2 * size_of::<M>());
    let encoding = RepresentationIdentifier::CDR_LE;
    rustdds::serialization::to_writer_with_rep_id(&mut bytes, message, encoding)
        .map_err(|error| format!("a {} cannot be serialised: {error}", short_type_name::<M>()))?;
    Ok(bytes)
}

fn short_type_name<M>() -> &'static str {
    std::any::type_name::<M>().rsplit("::").next().unwrap_or_default()
}

/// Makes rustdds pass the bytes of samples through as they are.
pub(crate) struct PayloadAdapter;

impl no_key::SerializerAdapter<SerializedPayload> for PayloadAdapter {
    type Error = Infallible;
    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }
    fn to_bytes(value: &SerializedPayload) -> Result<Bytes, Infallible> {
        Ok(value.body.clone())
    }
}

impl no_key::DeserializerAdapter<SerializedPayload> for PayloadAdapter {
    type Error = Infallible;
    type Decoded = SerializedPayload;
    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE, RepresentationIdentifier::CDR_BE]
    }
    fn transform_decoded(decoded: SerializedPayload) -> SerializedPayload {
        decoded
    }
}

impl no_key::DefaultDecoder<SerializedPayload> for PayloadAdapter {
    type Decoder = PayloadDecoder;
    const DECODER: PayloadDecoder = PayloadDecoder;
}

#[derive(Clone)]
pub(crate) struct PayloadDecoder;

impl no_key::Decode<'_, SerializedPayload> for PayloadDecoder {
    type Error = Infallible;
    fn decode_bytes(
        self,
        bytes: &[u8],
        encoding: RepresentationIdentifier,
    ) -> Result<SerializedPayload, Infallible> {
        Ok(SerializedPayload { body: Bytes::copy_from_slice(bytes), encoding })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_msgs::std_msgs::msg::Header;

    fn header() -> Header {
        Header { frame_id: "sensor".to_owned(), ..Header::default() }
    }

    #[test]
    fn a_payload_is_the_message_without_its_encapsulation_header() {
        let message: Bytes = puffer_msgs::cdr::to_bytes(&header()).unwrap().into();
        let payload = SerializedPayload::from_message(&message);
        assert_eq!(payload.body[..], message[4..]);
        assert_eq!(payload.body[..], encode(&header()).unwrap()[..]);
        assert_eq!(payload.to_message(), message);
        assert_eq!(payload.decode::<Header>().unwrap(), header());
    }

    #[test]
    fn bytes_that_are_too_few_are_an_error_with_the_type() {
        for length in 0..4 {
            let message = Bytes::from(vec![0; length]);
            let payload = SerializedPayload::from_message(&message);
            assert!(payload.body.is_empty());
            let error = payload.decode::<Header>().unwrap_err();
            assert!(error.contains("0 bytes do not hold a Header"), "{error}");
        }
    }
}
