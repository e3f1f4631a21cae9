//! Samples as bytes: serialisation happens in one place, and services may put a header in front.

use bytes::{BufMut, Bytes, BytesMut};
use rustdds::{GUID, RepresentationIdentifier, SampleIdentity, no_key};
use serde::{Serialize, de::DeserializeOwned};
use std::convert::Infallible;

/// Bytes of the encapsulation header.
const HEADER: usize = 4;

/// The bytes of a sample, without the encapsulation header, and their byte order.
#[derive(Clone, Debug)]
pub(crate) struct Raw {
    pub body: Bytes,
    pub encoding: RepresentationIdentifier,
}

/// A sample that has come in.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    pub raw: Raw,
    /// Who wrote it, and the how-manieth it is.
    pub identity: SampleIdentity,
    /// The related sample identity of its inline QoS.
    pub related: Option<SampleIdentity>,
}

impl Sample {
    pub fn writer(&self) -> GUID {
        self.identity.writer_guid
    }
}

impl Raw {
    /// Of a message with its encapsulation header, as bags store it and tiles carry it: little-endian CDR.
    pub fn of_message(message: &Bytes) -> Raw {
        let body = message.slice(HEADER.min(message.len())..);
        Raw { body, encoding: RepresentationIdentifier::CDR_LE }
    }

    /// The message with its encapsulation header.
    pub fn message(&self) -> Bytes {
        let mut bytes = BytesMut::with_capacity(HEADER + self.body.len());
        bytes.put_slice(&self.encoding.to_bytes());
        bytes.put_slice(&[0, 0]);
        bytes.put_slice(&self.body);
        bytes.freeze()
    }

    pub fn decode<M: DeserializeOwned>(&self) -> Result<M, String> {
        rustdds::serialization::deserialize_from_cdr_with_rep_id(&self.body, self.encoding)
            .map(|(message, _)| message)
            .map_err(|error| {
                format!("{} bytes do not hold a {}: {error}", self.body.len(), short::<M>())
            })
    }
}

pub(crate) fn encode<M: Serialize>(message: &M) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::with_capacity(2 * size_of::<M>());
    let encoding = RepresentationIdentifier::CDR_LE;
    rustdds::serialization::to_writer_with_rep_id(&mut bytes, message, encoding)
        .map_err(|error| format!("a {} cannot be serialised: {error}", short::<M>()))?;
    Ok(bytes)
}

fn short<M>() -> &'static str {
    std::any::type_name::<M>().rsplit("::").next().unwrap_or_default()
}

/// Passes bytes through rustdds as they are.
pub(crate) struct RawAdapter;

impl no_key::SerializerAdapter<Raw> for RawAdapter {
    type Error = Infallible;
    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }
    fn to_bytes(value: &Raw) -> Result<Bytes, Infallible> {
        Ok(value.body.clone())
    }
}

impl no_key::DeserializerAdapter<Raw> for RawAdapter {
    type Error = Infallible;
    type Decoded = Raw;
    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE, RepresentationIdentifier::CDR_BE]
    }
    fn transform_decoded(decoded: Raw) -> Raw {
        decoded
    }
}

impl no_key::DefaultDecoder<Raw> for RawAdapter {
    type Decoder = RawDecoder;
    const DECODER: RawDecoder = RawDecoder;
}

#[derive(Clone)]
pub(crate) struct RawDecoder;

impl no_key::Decode<'_, Raw> for RawDecoder {
    type Error = Infallible;
    fn decode_bytes(
        self,
        bytes: &[u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Raw, Infallible> {
        Ok(Raw { body: Bytes::copy_from_slice(bytes), encoding })
    }
}
