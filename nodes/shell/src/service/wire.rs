//! How requests and replies say which belong together: the conventions of rmw_fastrtps ("Enhanced") and of
//! rmw_cyclonedds.

use crate::ServiceMapping;
use crate::dds::{Raw, Sample};
use rustdds::{GUID, RepresentationIdentifier, SampleIdentity, SequenceNumber};

/// Which call a request or reply belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct CallId {
    /// Enhanced: GUID of the client's reply reader or request writer. Cyclone: the first half of its writer's
    /// GUID, then the 8 bytes that the client chose.
    pub client: [u8; 16],
    pub sequence: i64,
}

/// Bytes of the header that rmw_cyclonedds puts in front of the payload: 8 chosen by the client, then a 64-bit
/// sequence number.
const CYCLONE_HEADER: usize = 16;

/// What goes out: bytes and the related sample identity of the inline QoS.
pub(crate) type Outgoing = (Vec<u8>, Option<SampleIdentity>);

/// A request. `first` is the sequence number of the first attempt of the same call: Enhanced servers of this
/// suite know repetitions by it; others see an unknown number, as rmw_fastrtps sends it, and count for
/// themselves. Cyclone needs the number itself.
pub(crate) fn request(
    mapping: ServiceMapping,
    payload: &[u8],
    writer: GUID,
    reply_reader: GUID,
    first: Option<i64>,
) -> Outgoing {
    match mapping {
        ServiceMapping::Enhanced => {
            let sequence_number = first.map_or(SequenceNumber::UNKNOWN, SequenceNumber::from);
            let related = SampleIdentity { writer_guid: reply_reader, sequence_number };
            (payload.to_vec(), Some(related))
        }
        ServiceMapping::Cyclone => {
            (with_header(cyclone_tag(writer), first.unwrap_or_default(), payload), None)
        }
    }
}

/// Which call a request belongs to, and its payload.
pub(crate) fn read_request(
    mapping: ServiceMapping,
    sample: &Sample,
) -> Result<(CallId, Raw), String> {
    match mapping {
        ServiceMapping::Enhanced => {
            let own = sample.identity;
            let known = sample.related.filter(|related| related.writer_guid != GUID::GUID_UNKNOWN);
            let client = known.map_or(own.writer_guid, |related| related.writer_guid);
            let sequence = known
                .map(|related| related.sequence_number)
                .filter(|number| *number != SequenceNumber::UNKNOWN && i64::from(*number) > 0)
                .unwrap_or(own.sequence_number);
            let id = CallId { client: client.to_bytes(), sequence: i64::from(sequence) };
            Ok((id, sample.raw.clone()))
        }
        ServiceMapping::Cyclone => {
            let (tag, sequence, payload) = split_header(&sample.raw)?;
            let mut client = [0; 16];
            client[..8].copy_from_slice(&sample.writer().to_bytes()[..8]);
            client[8..].copy_from_slice(&tag);
            Ok((CallId { client, sequence }, payload))
        }
    }
}

/// The reply to call `id`.
pub(crate) fn reply(mapping: ServiceMapping, payload: &[u8], id: CallId) -> Outgoing {
    match mapping {
        ServiceMapping::Enhanced => {
            let related = SampleIdentity {
                writer_guid: GUID::from_bytes(id.client),
                sequence_number: SequenceNumber::from(id.sequence),
            };
            (payload.to_vec(), Some(related))
        }
        ServiceMapping::Cyclone => {
            let mut tag = [0; 8];
            tag.copy_from_slice(&id.client[8..]);
            (with_header(tag, id.sequence, payload), None)
        }
    }
}

/// The sequence number of the call that a reply answers, and its payload; `None` if another client asked.
pub(crate) fn read_reply(
    mapping: ServiceMapping,
    sample: &Sample,
    writer: GUID,
    reply_reader: GUID,
) -> Result<Option<(i64, Raw)>, String> {
    match mapping {
        ServiceMapping::Enhanced => {
            let related = sample.related.ok_or(
                "a reply without related sample identity: does its server speak rmw_cyclonedds's \
                 convention? Set RMW_IMPLEMENTATION alike on both sides",
            )?;
            let mine = related.writer_guid == writer || related.writer_guid == reply_reader;
            Ok(mine.then(|| (i64::from(related.sequence_number), sample.raw.clone())))
        }
        ServiceMapping::Cyclone => {
            let (tag, sequence, payload) = split_header(&sample.raw)?;
            Ok((tag == cyclone_tag(writer)).then_some((sequence, payload)))
        }
    }
}

/// 8 bytes that no other client chooses: the halves of the GUID, which differ in host, process and endpoint,
/// folded together.
fn cyclone_tag(writer: GUID) -> [u8; 8] {
    let guid = writer.to_bytes();
    std::array::from_fn(|i| guid[i] ^ guid[i + 8])
}

fn with_header(tag: [u8; 8], sequence: i64, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(CYCLONE_HEADER + payload.len());
    bytes.extend(tag);
    bytes.extend(sequence.to_le_bytes());
    bytes.extend(payload);
    bytes
}

fn split_header(raw: &Raw) -> Result<([u8; 8], i64, Raw), String> {
    let short = || format!("{} bytes are too few for rmw_cyclonedds's header", raw.body.len());
    let (header, _) = raw.body.split_first_chunk::<CYCLONE_HEADER>().ok_or_else(short)?;
    let (tag, number) = header.split_first_chunk::<8>().ok_or_else(short)?;
    let number = number.first_chunk::<8>().ok_or_else(short)?;
    let sequence = match raw.encoding {
        RepresentationIdentifier::CDR_BE => i64::from_be_bytes(*number),
        _ => i64::from_le_bytes(*number),
    };
    let payload = Raw { body: raw.body.slice(CYCLONE_HEADER..), encoding: raw.encoding };
    Ok((*tag, sequence, payload))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;

    const WRITER: [u8; 16] = [1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 1, 3];
    const READER: [u8; 16] = [1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 2, 4];
    const OTHER: [u8; 16] = [9; 16];

    fn sample((bytes, related): Outgoing, writer: [u8; 16], sequence: i64) -> Sample {
        Sample {
            raw: Raw { body: Bytes::from(bytes), encoding: RepresentationIdentifier::CDR_LE },
            identity: SampleIdentity {
                writer_guid: GUID::from_bytes(writer),
                sequence_number: SequenceNumber::from(sequence),
            },
            related,
        }
    }

    fn guid(bytes: [u8; 16]) -> GUID {
        GUID::from_bytes(bytes)
    }

    #[test]
    fn an_enhanced_request_carries_the_reply_reader_and_an_unknown_number() {
        let sent = request(ServiceMapping::Enhanced, b"abcd", guid(WRITER), guid(READER), None);
        assert_eq!(sent.0, b"abcd");
        let related = sent.1.unwrap();
        assert_eq!(related.writer_guid.to_bytes(), READER);
        assert_eq!((related.sequence_number.high(), related.sequence_number.low()), (-1, 0));
        let (id, payload) =
            read_request(ServiceMapping::Enhanced, &sample(sent, WRITER, 7)).unwrap();
        assert_eq!(id, CallId { client: READER, sequence: 7 });
        assert_eq!(&payload.body[..], b"abcd");
    }

    #[test]
    fn an_enhanced_repetition_has_the_id_of_the_first_attempt() {
        let again = request(ServiceMapping::Enhanced, b"", guid(WRITER), guid(READER), Some(7));
        let (id, _) = read_request(ServiceMapping::Enhanced, &sample(again, WRITER, 8)).unwrap();
        assert_eq!(id, CallId { client: READER, sequence: 7 });
        let bare = sample((Vec::new(), None), WRITER, 9);
        let (id, _) = read_request(ServiceMapping::Enhanced, &bare).unwrap();
        assert_eq!(id, CallId { client: WRITER, sequence: 9 });
    }

    #[test]
    fn an_enhanced_reply_names_the_client_by_reader_or_by_writer() {
        for client in [READER, WRITER, OTHER] {
            let sent = reply(ServiceMapping::Enhanced, b"yes", CallId { client, sequence: 7 });
            assert_eq!(sent.1.unwrap().writer_guid.to_bytes(), client);
            let got = read_reply(
                ServiceMapping::Enhanced,
                &sample(sent, OTHER, 1),
                guid(WRITER),
                guid(READER),
            )
            .unwrap();
            assert_eq!(got.map(|(sequence, _)| sequence), (client != OTHER).then_some(7));
        }
        let bare = sample((Vec::new(), None), OTHER, 1);
        let error = read_reply(ServiceMapping::Enhanced, &bare, guid(WRITER), guid(READER));
        assert!(error.unwrap_err().contains("RMW_IMPLEMENTATION"));
    }

    #[test]
    fn cyclone_puts_eight_bytes_and_a_number_in_front() {
        let sent = request(ServiceMapping::Cyclone, b"abcd", guid(WRITER), guid(READER), Some(258));
        assert_eq!(sent.0.len(), 20);
        assert_eq!(sent.0[8..], [2, 1, 0, 0, 0, 0, 0, 0, b'a', b'b', b'c', b'd']);
        assert!(sent.1.is_none());
        let tag = sent.0[..8].to_vec();
        let (id, payload) =
            read_request(ServiceMapping::Cyclone, &sample(sent, WRITER, 1)).unwrap();
        assert_eq!((id.sequence, &payload.body[..]), (258, &b"abcd"[..]));
        let back = reply(ServiceMapping::Cyclone, b"yes", id);
        assert_eq!(back.0[..8], tag[..]);
        let read = |writer| {
            let back = sample(back.clone(), OTHER, 1);
            read_reply(ServiceMapping::Cyclone, &back, guid(writer), guid(READER)).unwrap()
        };
        assert_eq!(read(WRITER).map(|(sequence, _)| sequence), Some(258));
        assert!(read(OTHER).is_none());
        let short = sample((vec![0; 15], None), WRITER, 1);
        assert!(read_request(ServiceMapping::Cyclone, &short).unwrap_err().contains("too few"));
    }

    #[test]
    fn a_big_endian_header_is_read_too() {
        let mut bytes = vec![7; 8];
        bytes.extend(258i64.to_be_bytes());
        let mut sample = sample((bytes, None), WRITER, 1);
        sample.raw.encoding = RepresentationIdentifier::CDR_BE;
        assert_eq!(read_request(ServiceMapping::Cyclone, &sample).unwrap().0.sequence, 258);
    }
}
