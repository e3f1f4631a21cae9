//! How requests and replies say which belong together, by the conventions of rmw_fastrtps
//! ("Enhanced", after the profile of the DDS-RPC standard) and of rmw_cyclonedds ("Cyclone").

use crate::ServiceMapping;
use crate::dds::{ReceivedSample, SerializedPayload};
use rustdds::{GUID, RepresentationIdentifier, SampleIdentity, SequenceNumber};

/// Which call a request or reply belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct CallId {
    /// Enhanced: the GUID of the client's reply reader or request writer. Cyclone: the first half
    /// of the GUID of the client's request writer, then the 8 bytes that the client chose.
    pub client: [u8; 16],
    pub sequence: i64,
}

/// Length of the header that rmw_cyclonedds puts in front of the payload: 8 bytes chosen by the
/// client, then a 64-bit sequence number.
const CYCLONE_HEADER_BYTES: usize = 16;

/// Enhanced: a longer payload may leave in fragments, and rustdds 0.15.1 writes the inline QoS of a
/// fragment in such a way that nobody can read it. The identity of such a payload stands behind it,
/// where a reader of CDR does not look. A payload of up to this length leaves whole through an
/// interface with an MTU of at least 1,156 bytes.
const MAX_UNFRAGMENTED_BYTES: usize = 1024;
/// Marks an identity that stands behind the payload.
const TRAILER_MARK: [u8; 8] = *b"\0related";
/// Length of the trailer: mark, GUID, sequence number.
const TRAILER_BYTES: usize = 8 + 16 + 8;
/// A trailer starts, and so ends, at a multiple of this many bytes, as RTPS aligns submessages. The
/// receiver's interface decides whether a sample leaves in fragments, which keep its length, or
/// whole and padded to a multiple of this; the trailer must be the last in both cases.
const TRAILER_ALIGNMENT_BYTES: usize = 4;

/// First bytes of the GUIDs that Cyclone DDS gives out: its RTPS vendor number.
const CYCLONE_VENDOR: [u8; 2] = [1, 16];

/// A sample to write: its bytes and the related sample identity of its inline QoS.
pub(crate) type OutgoingSample = (Vec<u8>, Option<SampleIdentity>);

/// The sample of a request. `first` is the sequence number of the first attempt of the same call:
/// Enhanced servers of this crate know repetitions by it. The first attempt itself bears an unknown
/// number, as rmw_fastrtps sends it, and servers take the number of the sample. Cyclone needs the
/// number in each attempt.
pub(crate) fn request(
    mapping: ServiceMapping,
    payload: &[u8],
    writer: GUID,
    reply_reader: GUID,
    first: Option<i64>,
) -> OutgoingSample {
    match mapping {
        ServiceMapping::Enhanced => {
            let sequence_number = first.map_or(SequenceNumber::UNKNOWN, SequenceNumber::from);
            let related = SampleIdentity { writer_guid: reply_reader, sequence_number };
            attach_identity(payload, related)
        }
        ServiceMapping::Cyclone => {
            (prepend_header(cyclone_tag(writer), first.unwrap_or_default(), payload), None)
        }
    }
}

/// Reads which call a request belongs to, and its payload.
pub(crate) fn read_request(
    mapping: ServiceMapping,
    sample: &ReceivedSample,
) -> Result<(CallId, SerializedPayload), String> {
    match mapping {
        ServiceMapping::Enhanced => {
            let own = sample.identity;
            let (related, payload) = split_identity(sample);
            let known = related.filter(|related| related.writer_guid != GUID::GUID_UNKNOWN);
            let client = known.map_or(own.writer_guid, |related| related.writer_guid);
            let sequence = known
                .map(|related| related.sequence_number)
                .filter(|number| *number != SequenceNumber::UNKNOWN && i64::from(*number) > 0)
                .unwrap_or(own.sequence_number);
            let id = CallId { client: client.to_bytes(), sequence: i64::from(sequence) };
            Ok((id, payload))
        }
        ServiceMapping::Cyclone => {
            let (tag, sequence, payload) = split_header(&sample.payload)?;
            let mut client = [0; 16];
            client[..8].copy_from_slice(&sample.writer().to_bytes()[..8]);
            client[8..].copy_from_slice(&tag);
            Ok((CallId { client, sequence }, payload))
        }
    }
}

/// The sample of the reply to call `id`.
pub(crate) fn reply(mapping: ServiceMapping, payload: &[u8], id: CallId) -> OutgoingSample {
    match mapping {
        ServiceMapping::Enhanced => {
            let related = SampleIdentity {
                writer_guid: GUID::from_bytes(id.client),
                sequence_number: SequenceNumber::from(id.sequence),
            };
            attach_identity(payload, related)
        }
        ServiceMapping::Cyclone => {
            let mut tag = [0; 8];
            tag.copy_from_slice(&id.client[8..]);
            (prepend_header(tag, id.sequence, payload), None)
        }
    }
}

/// Reads the sequence number of the call that a reply answers, and its payload. `None` if the reply
/// is for another client.
pub(crate) fn read_reply(
    mapping: ServiceMapping,
    sample: &ReceivedSample,
    writer: GUID,
    reply_reader: GUID,
) -> Result<Option<(i64, SerializedPayload)>, String> {
    match mapping {
        ServiceMapping::Enhanced => {
            let (related, payload) = split_identity(sample);
            let related = related.ok_or_else(|| missing_identity_error(sample))?;
            let is_for_us = related.writer_guid == writer || related.writer_guid == reply_reader;
            Ok(is_for_us.then(|| (i64::from(related.sequence_number), payload)))
        }
        ServiceMapping::Cyclone => {
            let (tag, sequence, payload) = split_header(&sample.payload)?;
            Ok((tag == cyclone_tag(writer)).then_some((sequence, payload)))
        }
    }
}

/// 8 bytes that no other client chooses: the two halves of the GUID, which differ between hosts,
/// processes and endpoints, combined by exclusive or.
fn cyclone_tag(writer: GUID) -> [u8; 8] {
    let guid = writer.to_bytes();
    std::array::from_fn(|i| guid[i] ^ guid[i + 8])
}

/// A payload with its identity, in the inline QoS or in a trailer.
fn attach_identity(payload: &[u8], related: SampleIdentity) -> OutgoingSample {
    if payload.len() <= MAX_UNFRAGMENTED_BYTES {
        return (payload.to_vec(), Some(related));
    }
    let mut bytes = payload.to_vec();
    bytes.resize(payload.len().next_multiple_of(TRAILER_ALIGNMENT_BYTES), 0);
    bytes.extend(TRAILER_MARK);
    bytes.extend(related.writer_guid.to_bytes());
    bytes.extend(i64::from(related.sequence_number).to_le_bytes());
    (bytes, None)
}

/// The error of a reply that does not say for whom it is.
fn missing_identity_error(sample: &ReceivedSample) -> String {
    let cause = if sample.writer().to_bytes().starts_with(&CYCLONE_VENDOR) {
        "its server runs on Cyclone DDS; set RMW_IMPLEMENTATION=rmw_cyclonedds_cpp here, too"
    } else {
        "either its server runs with RMW_IMPLEMENTATION=rmw_cyclonedds_cpp, which this node must \
         then have, too, or it answers by no convention of ROS 2"
    };
    format!(
        "a reply of {} bytes without related sample identity: {cause}",
        sample.payload.body.len()
    )
}

/// The identity of a sample, from its inline QoS or its trailer, and its payload, which zeros may
/// follow.
fn split_identity(sample: &ReceivedSample) -> (Option<SampleIdentity>, SerializedPayload) {
    let body = &sample.payload.body;
    let found = body
        .len()
        .checked_sub(TRAILER_BYTES)
        .filter(|start| sample.related.is_none() && body[*start..].starts_with(&TRAILER_MARK));
    let Some(start) = found else { return (sample.related, sample.payload.clone()) };
    let (mut guid, mut number) = ([0; 16], [0; 8]);
    guid.copy_from_slice(&body[start + 8..start + 24]);
    number.copy_from_slice(&body[start + 24..]);
    let related = SampleIdentity {
        writer_guid: GUID::from_bytes(guid),
        sequence_number: SequenceNumber::from(i64::from_le_bytes(number)),
    };
    (
        Some(related),
        SerializedPayload { body: body.slice(..start), encoding: sample.payload.encoding },
    )
}

/// The payload with the header of rmw_cyclonedds in front.
fn prepend_header(tag: [u8; 8], sequence: i64, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(CYCLONE_HEADER_BYTES + payload.len());
    bytes.extend(tag);
    bytes.extend(sequence.to_le_bytes());
    bytes.extend(payload);
    bytes
}

/// The tag and the sequence number of the header of rmw_cyclonedds, and the payload behind it.
fn split_header(sample: &SerializedPayload) -> Result<([u8; 8], i64, SerializedPayload), String> {
    let SerializedPayload { body, encoding } = sample;
    let Some((header, _)) = body.split_first_chunk::<CYCLONE_HEADER_BYTES>() else {
        return Err(format!("{} bytes are too few for rmw_cyclonedds's header", body.len()));
    };
    let (mut tag, mut number) = ([0; 8], [0; 8]);
    tag.copy_from_slice(&header[..8]);
    number.copy_from_slice(&header[8..]);
    let sequence = match *encoding {
        RepresentationIdentifier::CDR_BE => i64::from_be_bytes(number),
        _ => i64::from_le_bytes(number),
    };
    let body = body.slice(CYCLONE_HEADER_BYTES..);
    Ok((tag, sequence, SerializedPayload { body, encoding: *encoding }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;

    const WRITER: [u8; 16] = [1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 1, 3];
    const READER: [u8; 16] = [1, 18, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 2, 4];
    const OTHER: [u8; 16] = [9; 16];

    fn sample((bytes, related): OutgoingSample, writer: [u8; 16], sequence: i64) -> ReceivedSample {
        ReceivedSample {
            payload: SerializedPayload {
                body: Bytes::from(bytes),
                encoding: RepresentationIdentifier::CDR_LE,
            },
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
    fn padded((mut bytes, related): OutgoingSample) -> OutgoingSample {
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        (bytes, related)
    }

    /// Whether `padded` is the payload and up to three zeros.
    fn is_padded(padded: &SerializedPayload, payload: &[u8]) -> bool {
        let rest = padded.body.strip_prefix(payload);
        rest.is_some_and(|rest| rest.len() < 4 && rest.iter().all(|byte| *byte == 0))
    }

    #[test]
    fn what_may_leave_in_fragments_has_its_identity_behind_it() {
        let mapping = ServiceMapping::Enhanced;
        for (beyond, first) in (1..=8).flat_map(|beyond| [(beyond, None), (beyond, Some(7))]) {
            let long = vec![7; MAX_UNFRAGMENTED_BYTES + beyond];
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
        let back = sample(back, OTHER, 1);
        for (writer, expected) in [(WRITER, Some(258)), (OTHER, None)] {
            let got = read_reply(ServiceMapping::Cyclone, &back, guid(writer), guid(READER));
            assert_eq!(got.unwrap().map(|(sequence, _)| sequence), expected);
        }
        let short = sample((vec![0; 15], None), WRITER, 1);
        assert!(read_request(ServiceMapping::Cyclone, &short).unwrap_err().contains("too few"));
    }

    #[test]
    fn a_big_endian_header_is_read_too() {
        let mut bytes = vec![7; 8];
        bytes.extend(258i64.to_be_bytes());
        let mut sample = sample((bytes, None), WRITER, 1);
        sample.payload.encoding = RepresentationIdentifier::CDR_BE;
        assert_eq!(read_request(ServiceMapping::Cyclone, &sample).unwrap().0.sequence, 258);
    }
}
