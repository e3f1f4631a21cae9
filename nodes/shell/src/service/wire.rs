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

/// Enhanced: longer payloads, in bytes, may leave in fragments, and rustdds 0.15.1 writes a
/// fragment's inline QoS so that nobody can read it. Their identity stands behind the payload,
/// where a reader of CDR does not look. Through an interface with an MTU of at least 1,156 bytes
/// this length leaves whole.
const LARGEST_WHOLE: usize = 1024;
/// In front of an identity that stands behind the payload.
const TRAILER_MARK: [u8; 8] = *b"\0related";
/// Mark, GUID, sequence number.
const TRAILER: usize = 8 + 16 + 8;
/// An identity behind a payload starts, and so ends, at a multiple of this many bytes, as RTPS
/// aligns submessages. The receiver's interface decides whether a sample leaves in fragments, which
/// keep its length, or whole and padded to this; the identity must be the last either way.
const TRAILER_ALIGNMENT: usize = 4;

/// First bytes of the GUIDs that Cyclone DDS gives out: its vendor number.
const CYCLONE_VENDOR: [u8; 2] = [1, 16];

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
            with_identity(payload, related)
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
            let (related, raw) = split_identity(sample);
            let known = related.filter(|related| related.writer_guid != GUID::GUID_UNKNOWN);
            let client = known.map_or(own.writer_guid, |related| related.writer_guid);
            let sequence = known
                .map(|related| related.sequence_number)
                .filter(|number| *number != SequenceNumber::UNKNOWN && i64::from(*number) > 0)
                .unwrap_or(own.sequence_number);
            let id = CallId { client: client.to_bytes(), sequence: i64::from(sequence) };
            Ok((id, raw))
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
            with_identity(payload, related)
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
            let (related, raw) = split_identity(sample);
            let related = related.ok_or_else(|| unaddressed(sample))?;
            let mine = related.writer_guid == writer || related.writer_guid == reply_reader;
            Ok(mine.then(|| (i64::from(related.sequence_number), raw)))
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

/// A payload with its identity, in the inline QoS or behind it.
fn with_identity(payload: &[u8], related: SampleIdentity) -> Outgoing {
    if payload.len() <= LARGEST_WHOLE {
        return (payload.to_vec(), Some(related));
    }
    let mut bytes = payload.to_vec();
    bytes.resize(payload.len().next_multiple_of(TRAILER_ALIGNMENT), 0);
    bytes.extend(TRAILER_MARK);
    bytes.extend(related.writer_guid.to_bytes());
    bytes.extend(i64::from(related.sequence_number).to_le_bytes());
    (bytes, None)
}

/// What is wrong with a reply that does not say whom it is for.
fn unaddressed(sample: &Sample) -> String {
    let cause = if sample.writer().to_bytes().starts_with(&CYCLONE_VENDOR) {
        "its server runs on Cyclone DDS; set RMW_IMPLEMENTATION=rmw_cyclonedds_cpp here, too"
    } else {
        "either its server runs with RMW_IMPLEMENTATION=rmw_cyclonedds_cpp, which this node must \
         then have, too, or it answers by no convention of ROS 2"
    };
    format!("a reply of {} bytes without related sample identity: {cause}", sample.raw.body.len())
}

/// The identity of a sample, wherever it stands, and its payload, which zeros may follow.
fn split_identity(sample: &Sample) -> (Option<SampleIdentity>, Raw) {
    let body = &sample.raw.body;
    let found = body
        .len()
        .checked_sub(TRAILER)
        .filter(|start| sample.related.is_none() && body[*start..].starts_with(&TRAILER_MARK));
    let Some(start) = found else { return (sample.related, sample.raw.clone()) };
    let (mut guid, mut number) = ([0; 16], [0; 8]);
    guid.copy_from_slice(&body[start + 8..start + 24]);
    number.copy_from_slice(&body[start + 24..]);
    let related = SampleIdentity {
        writer_guid: GUID::from_bytes(guid),
        sequence_number: SequenceNumber::from(i64::from_le_bytes(number)),
    };
    (Some(related), Raw { body: body.slice(..start), encoding: sample.raw.encoding })
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

    /// As rustdds hands over a sample that was sent whole: padded to a multiple of four bytes.
    fn padded((mut bytes, related): Outgoing) -> Outgoing {
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        (bytes, related)
    }

    /// Whether `raw` is the payload and up to three zeros.
    fn is_padded(raw: &Raw, payload: &[u8]) -> bool {
        let rest = raw.body.strip_prefix(payload);
        rest.is_some_and(|rest| rest.len() < 4 && rest.iter().all(|byte| *byte == 0))
    }

    #[test]
    fn what_may_leave_in_fragments_has_its_identity_behind_it() {
        let mapping = ServiceMapping::Enhanced;
        for (beyond, first) in (1..=8).flat_map(|beyond| [(beyond, None), (beyond, Some(7))]) {
            let long = vec![7; LARGEST_WHOLE + beyond];
            for arrived in [|sent| sent, padded] {
                let sent = request(mapping, &long, guid(WRITER), guid(READER), first);
                assert!(sent.1.is_none());
                let (id, payload) =
                    read_request(mapping, &sample(arrived(sent), WRITER, 7)).unwrap();
                assert_eq!(id, CallId { client: READER, sequence: 7 }, "{beyond}");
                assert!(is_padded(&payload, &long), "{beyond}");
                let back = sample(arrived(reply(mapping, &long, id)), OTHER, 1);
                let got = read_reply(mapping, &back, guid(WRITER), guid(READER)).unwrap();
                let (sequence, payload) = got.unwrap();
                assert!(sequence == 7 && is_padded(&payload, &long), "{beyond}");
            }
        }
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
        let cyclone = [[1, 16].as_slice(), &OTHER[2..]].concat().try_into().unwrap();
        for (writer, says) in [(cyclone, "its server runs on Cyclone DDS"), (OTHER, "either")] {
            let bare = sample((vec![0; 9], None), writer, 1);
            let error = read_reply(ServiceMapping::Enhanced, &bare, guid(WRITER), guid(READER));
            let error = error.unwrap_err();
            assert!(error.contains("9 bytes") && error.contains(says), "{error}");
        }
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
