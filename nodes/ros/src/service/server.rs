//! The server of a service.

use super::correlation::{self, CallId};
use super::service_endpoints::{SERVICE_QOS_DEPTH, reply_type, request_type};
use crate::ServiceMapping;
use crate::dds::{Participant, Reader, Writer, encode, reply_topic, request_topic};
use anyhow::Result;
use puffer_msgs::Service;
use rustdds::GUID;
use std::collections::VecDeque;
use std::marker::PhantomData;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Number of answers kept for clients that repeat a request.
const MAX_CACHED_REPLIES: usize = 32;
/// Longer answers are not kept, bytes.
const MAX_CACHED_REPLY_BYTES: usize = 1 << 16;
/// How long an answer waits until its client's reader is matched: discovery tells one side before
/// the other.
const MAX_CLIENT_MATCH_WAIT: Duration = Duration::from_secs(1);

/// Receives the requests of a service and sends the answers.
pub(crate) struct Server<S> {
    name: String,
    mapping: ServiceMapping,
    reader: Reader,
    writer: Writer,
    /// The newest calls and their answers, for clients that repeat a request.
    calls: Mutex<VecDeque<(CallId, Option<Vec<u8>>)>>,
    service: PhantomData<fn(S)>,
}

/// A request that waits for its answer.
pub(crate) struct Call {
    id: CallId,
    /// The DDS writer of the request.
    client: GUID,
}

impl Call {
    /// Whether `endpoint` belongs to the participant of the client.
    pub fn is_from_participant_of(&self, endpoint: &GUID) -> bool {
        self.client.prefix == endpoint.prefix
    }
}

impl<S: Service> Server<S> {
    /// A server of the service with the absolute name `name`.
    pub fn new(dds: &Participant, mapping: ServiceMapping, name: &str) -> Result<Self> {
        let qos = crate::qos::service(SERVICE_QOS_DEPTH);
        Ok(Self {
            name: name.to_owned(),
            mapping,
            writer: dds.writer(&reply_topic(name), &reply_type::<S>(), &qos)?,
            reader: dds.reader(&request_topic(name), &request_type::<S>(), &qos)?,
            calls: Mutex::default(),
            service: PhantomData,
        })
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// The next request that is not a repetition.
    pub async fn receive(&self) -> (Call, S::Request) {
        loop {
            let request = self.reader.next().await.and_then(|sample| {
                let (id, payload) = correlation::read_request(self.mapping, &sample)?;
                Ok((Call { id, client: sample.writer() }, payload))
            });
            let (call, payload) = match request {
                Ok(request) => request,
                Err(error) => {
                    tracing::warn!("{}: request ignored: {error}", self.name);
                    continue;
                }
            };
            if self.is_new(&call) {
                match payload.decode() {
                    Ok(request) => return (call, request),
                    Err(error) => tracing::warn!("{}: request ignored: {error}", self.name),
                }
            }
        }
    }

    /// Notes the call and returns whether it is new; a repeated call is answered from memory.
    fn is_new(&self, call: &Call) -> bool {
        let mut calls = self.calls.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, answer)) = calls.iter().find(|(id, _)| *id == call.id) {
            if let Some(answer) = answer {
                self.send(answer, call.id);
            }
            return false;
        }
        if calls.len() == MAX_CACHED_REPLIES {
            calls.pop_front();
        }
        calls.push_back((call.id, None));
        true
    }

    /// Sends the answer to a call, once its client is matched.
    pub async fn answer(&self, call: &Call, response: &S::Response) {
        let payload = match encode(response) {
            Ok(payload) => payload,
            Err(error) => {
                tracing::error!("{}: no answer: {error}", self.name);
                return;
            }
        };
        let writer = self.writer.guid();
        let matched = self.writer.matches().wait(|matches| {
            matches.remotes_of(writer).iter().any(|reader| call.is_from_participant_of(reader))
        });
        // A client that has gone meanwhile is no fault.
        let _ = tokio::time::timeout(MAX_CLIENT_MATCH_WAIT, matched).await;
        self.send(&payload, call.id);
        if payload.len() <= MAX_CACHED_REPLY_BYTES {
            let mut calls = self.calls.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(known) = calls.iter_mut().find(|(id, _)| *id == call.id) {
                known.1 = Some(payload);
            }
        }
    }

    fn send(&self, payload: &[u8], id: CallId) {
        let (bytes, related) = correlation::reply(self.mapping, payload, id);
        if let Err(error) = self.writer.write(bytes, related) {
            tracing::warn!("{}: answer lost: {error}", self.name);
        }
    }
}
