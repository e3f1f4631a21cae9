//! Whole messages passed through DDS unread: CDR with its encapsulation header, as bags store them.

use bytes::{BufMut, Bytes, BytesMut};
use rustdds::RepresentationIdentifier;
use rustdds::no_key;

/// Bytes of the encapsulation header.
const HEADER: usize = 4;
/// Little-endian CDR, no options.
const LITTLE_ENDIAN: [u8; HEADER] = [0, 1, 0, 0];

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
