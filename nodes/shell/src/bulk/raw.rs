//! Messages as bytes: CDR with its encapsulation header, as bags store them.

use bytes::{BufMut, Bytes, BytesMut};
use rustdds::RepresentationIdentifier;
use rustdds::no_key;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Bytes of the encapsulation header.
const HEADER: usize = 4;
/// Little-endian CDR, no options.
const LITTLE_ENDIAN: [u8; HEADER] = [0, 1, 0, 0];

/// Serializes `message`, little-endian, with the encapsulation header.
///
/// # Errors
/// In words, if the type has no CDR.
pub fn to_cdr<M: Serialize>(message: &M) -> Result<Bytes, String> {
    let mut bytes = LITTLE_ENDIAN.to_vec();
    rustdds::serialization::to_writer_with_rep_id(
        &mut bytes,
        message,
        RepresentationIdentifier::CDR_LE,
    )
    .map_err(|error| error.to_string())?;
    Ok(bytes.into())
}

/// The message that `bytes`, with encapsulation header, stand for.
///
/// # Errors
/// In words, if they do not fit the type.
pub fn from_cdr<M: DeserializeOwned>(bytes: &[u8]) -> Result<M, String> {
    let (header, body) =
        bytes.split_at_checked(HEADER).ok_or_else(|| format!("{} bytes only", bytes.len()))?;
    let encoding = RepresentationIdentifier::from_bytes(header)
        .map_err(|error| format!("encapsulation header {header:?}: {error}"))?;
    rustdds::serialization::deserialize_from_cdr_with_rep_id(body, encoding)
        .map(|(message, _)| message)
        .map_err(|error| error.to_string())
}

/// A message that is passed on unread.
pub(crate) struct Raw(pub(crate) Bytes);

/// Passes a message's bytes through DDS.
pub(crate) struct RawAdapter;

const READABLE: [RepresentationIdentifier; 2] =
    [RepresentationIdentifier::CDR_LE, RepresentationIdentifier::CDR_BE];

impl no_key::DeserializerAdapter<Raw> for RawAdapter {
    type Error = std::io::Error;
    type Decoded = Raw;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &READABLE
    }

    fn transform_decoded(decoded: Raw) -> Raw {
        decoded
    }
}

impl no_key::DefaultDecoder<Raw> for RawAdapter {
    type Decoder = RawDecoder;
    const DECODER: RawDecoder = RawDecoder;
}

/// Copies a message's bytes.
#[derive(Clone)]
pub(crate) struct RawDecoder;

impl no_key::Decode<'_, Raw> for RawDecoder {
    type Error = std::io::Error;

    fn decode_bytes(
        self,
        body: &[u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Raw, std::io::Error> {
        let mut bytes = BytesMut::with_capacity(HEADER + body.len());
        let header =
            if encoding == RepresentationIdentifier::CDR_BE { [0; HEADER] } else { LITTLE_ENDIAN };
        bytes.put_slice(&header);
        bytes.put_slice(body);
        Ok(Raw(bytes.freeze()))
    }
}

impl no_key::SerializerAdapter<Raw> for RawAdapter {
    type Error = std::io::Error;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(value: &Raw) -> Result<Bytes, std::io::Error> {
        Ok(value.0.slice(HEADER.min(value.0.len())..))
    }
}
