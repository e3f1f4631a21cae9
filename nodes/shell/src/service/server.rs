//! The serving end of a service.

use super::wire::{self, CallId};
use super::{SERVICE_QOS_DEPTH, endpoint_types};
use crate::ServiceMapping;
use crate::dds::{Dds, Reader, Writer, encode};
use anyhow::Result;
use puffer_msgs::Service;
use rustdds::GUID;
use std::collections::VecDeque;
use std::marker::PhantomData;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Answers kept for clients that repeat a request.
const ANSWERS_KEPT: usize = 32;
/// Longer answers are not kept.
const ANSWER_KEPT_BYTES: usize = 1 << 16;
/// How long an answer waits until its client's reader is matched: discovery tells one side before the other.
const CLIENT_WAIT: Duration = Duration::from_secs(1);

pub(crate) struct Server<S> {
    name: String,
    mapping: ServiceMapping,
    reader: Reader,
    writer: Writer,
    calls: Mutex<VecDeque<(CallId, Option<Vec<u8>>)>>,
    service: PhantomData<fn(S)>,
}

/// A request that waits for its answer.
pub(crate) struct Call {
    id: CallId,
    asker: GUID,
}

impl Call {
    /// Whether `endpoint` belongs to the participant that asks.
    pub fn is_from_participant_of(&self, endpoint: &GUID) -> bool {
        self.asker.prefix == endpoint.prefix
    }
}

impl<S: Service> Server<S> {
    /// `name` is absolute.
    pub fn new(dds: &Dds, mapping: ServiceMapping, name: &str) -> Result<Self> {
        let (request, reply) = endpoint_types::<S>();
        let qos = crate::qos::service(SERVICE_QOS_DEPTH);
        Ok(Self {
            name: name.to_owned(),
            mapping,
            writer: dds.writer(&format!("rr{name}Reply"), &reply, &qos)?,
            reader: dds.reader(&format!("rq{name}Request"), &request, &qos)?,
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
                let (id, raw) = wire::read_request(self.mapping, &sample)?;
                Ok((Call { id, asker: sample.writer() }, raw))
            });
            let (call, raw) = match request {
                Ok(request) => request,
                Err(error) => {
                    tracing::warn!("{}: request ignored: {error}", self.name);
                    continue;
                }
            };
            if self.is_new(&call) {
                match raw.decode() {
                    Ok(request) => return (call, request),
                    Err(error) => tracing::warn!("{}: request ignored: {error}", self.name),
                }
            }
        }
    }

    /// Notes the call; answers a repetition from memory.
    fn is_new(&self, call: &Call) -> bool {
        let mut calls = self.calls.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, answer)) = calls.iter().find(|(id, _)| *id == call.id) {
            if let Some(answer) = answer {
                self.send(answer, call.id);
            }
            return false;
        }
        if calls.len() == ANSWERS_KEPT {
            calls.pop_front();
        }
        calls.push_back((call.id, None));
        true
    }

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
            matches.of(writer).iter().any(|reader| call.is_from_participant_of(reader))
        });
        // An asker that has gone meanwhile is nothing to complain about.
        let _ = tokio::time::timeout(CLIENT_WAIT, matched).await;
        self.send(&payload, call.id);
        if payload.len() <= ANSWER_KEPT_BYTES {
            let mut calls = self.calls.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(known) = calls.iter_mut().find(|(id, _)| *id == call.id) {
                known.1 = Some(payload);
            }
        }
    }

    fn send(&self, payload: &[u8], id: CallId) {
        let (bytes, related) = wire::reply(self.mapping, payload, id);
        if let Err(error) = self.writer.write(bytes, related) {
            tracing::warn!("{}: answer lost: {error}", self.name);
        }
    }
}
