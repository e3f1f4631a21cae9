//! The calling end of a service.

use super::wire;
use super::{CallError, SERVICE_QOS_DEPTH, endpoint_types};
use crate::dds::{Dds, Matches, Raw, Reader, Writer, encode};
use crate::{ServiceMapping, Stop};
use anyhow::Result;
use puffer_msgs::Service;
use rustdds::GUID;
use std::collections::{BTreeMap, BTreeSet};
use std::marker::PhantomData;
use std::sync::atomic::{AtomicI64, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};

/// How long the first attempt waits for an answer before the request is sent again, as long as the pair of
/// client and server has not worked before; doubled each time. The first call after matching can get lost,
/// because discovery tells one side before the other.
const FIRST_PATIENCE: Duration = Duration::from_secs(1);
/// How long a server that has just been found is given to find this client.
const SETTLING: Duration = Duration::from_millis(100);
/// How long a server that was there may be away during a call (it restarts) before the call is given up.
const ABSENCE: Duration = Duration::from_secs(3);

/// Calls a service; clones share it, and several calls may run at once.
pub struct Client<S> {
    inner: Arc<Inner>,
    service: PhantomData<fn(S)>,
}

impl<S> Clone for Client<S> {
    fn clone(&self) -> Self {
        Self { inner: Arc::clone(&self.inner), service: PhantomData }
    }
}

struct Inner {
    name: String,
    domain: u16,
    mapping: ServiceMapping,
    writer: Writer,
    reply_reader: GUID,
    pending: Mutex<BTreeMap<i64, UnboundedSender<Raw>>>,
    sequence: AtomicI64,
    /// Servers that have answered.
    proven: Mutex<BTreeSet<GUID>>,
    stop: Stop,
    dropped: Stop,
}

impl Drop for Inner {
    fn drop(&mut self) {
        self.dropped.stop();
    }
}

impl<S: Service> Client<S> {
    /// `name` is absolute.
    pub(crate) fn new(
        dds: &Dds,
        mapping: ServiceMapping,
        domain: u16,
        name: &str,
        stop: &Stop,
    ) -> Result<Self> {
        let (request, reply) = endpoint_types::<S>();
        let qos = crate::qos::service(SERVICE_QOS_DEPTH);
        let reader = dds.reader(&format!("rr{name}Reply"), &reply, &qos)?;
        let inner = Arc::new(Inner {
            name: name.to_owned(),
            domain,
            mapping,
            writer: dds.writer(&format!("rq{name}Request"), &request, &qos)?,
            reply_reader: reader.guid(),
            pending: Mutex::default(),
            sequence: AtomicI64::new(0),
            proven: Mutex::default(),
            stop: stop.clone(),
            dropped: Stop::new(),
        });
        tokio::spawn(dispatch(reader, Arc::downgrade(&inner), stop.clone(), inner.dropped.clone()));
        Ok(Self { inner, service: PhantomData })
    }

    /// Waits for a server, asks it, and waits for the answer; several calls may run at once. A request that
    /// seems lost is sent again under the same number, and servers of this suite answer it once only; a
    /// foreign server may see it twice, and only as long as it has not answered this client before.
    ///
    /// # Errors
    /// No server or no answer within `deadline` (wall time), a server that dies, or the node stops.
    pub async fn call(
        &self,
        request: &S::Request,
        deadline: Duration,
    ) -> Result<S::Response, CallError> {
        let inner = &self.inner;
        let payload = encode(request).map_err(|message| inner.transport(message))?;
        let attempts = AtomicU32::new(0);
        let exchange = tokio::time::timeout(deadline, async {
            inner.writer.matches().wait(|_| !inner.servers().is_empty()).await;
            inner.exchange(&payload, &attempts).await
        });
        let raw = match inner.stop.or(exchange).await {
            None => return Err(CallError::Stopped { service: inner.name.clone() }),
            Some(Ok(answer)) => answer?,
            Some(Err(_)) => return Err(inner.too_late(attempts.into_inner(), deadline)),
        };
        raw.decode().map_err(|message| inner.transport(message))
    }

    /// Asks a server that is known to be there, and waits without a deadline.
    ///
    /// # Errors
    /// As [`Client::call`], but for the deadline.
    pub(crate) async fn call_known(&self, request: &S::Request) -> Result<S::Response, CallError> {
        let inner = &self.inner;
        let payload = encode(request).map_err(|message| inner.transport(message))?;
        let attempts = AtomicU32::new(0);
        match inner.stop.or(inner.exchange(&payload, &attempts)).await {
            None => Err(CallError::Stopped { service: inner.name.clone() }),
            Some(raw) => raw?.decode().map_err(|message| inner.transport(message)),
        }
    }

    /// Whether a server is matched now.
    pub fn is_ready(&self) -> bool {
        !self.inner.servers().is_empty()
    }

    /// Who is matched with this and all other endpoints of the node.
    pub(crate) fn matches(&self) -> &Matches {
        self.inner.writer.matches()
    }

    /// Absolute name of the service.
    pub fn name(&self) -> &str {
        &self.inner.name
    }
}

impl Inner {
    /// Servers that are matched in both directions, by their reply writers.
    fn servers(&self) -> BTreeSet<GUID> {
        let matches = self.writer.matches();
        let takers = matches.of(self.writer.guid());
        let mut servers = matches.of(self.reply_reader);
        servers.retain(|server| takers.iter().any(|taker| taker.prefix == server.prefix));
        servers
    }

    async fn exchange(&self, payload: &[u8], attempts: &AtomicU32) -> Result<Raw, CallError> {
        let (sender, mut answers) = unbounded_channel();
        let mut call = PendingCall { inner: self, sequences: Vec::new() };
        let mut patience = FIRST_PATIENCE;
        if !self.are_proven(&self.servers()) {
            tokio::time::sleep(SETTLING).await;
        }
        loop {
            self.come_back().await?;
            let servers = self.servers();
            let gone = || servers.is_empty() || !self.servers().is_superset(&servers);
            call.send(payload, &sender)?;
            attempts.fetch_add(1, Ordering::Relaxed);
            let proven = self.are_proven(&servers);
            tokio::select! {
                answer = next(&mut answers) => {
                    let mut proven = self.proven.lock().unwrap_or_else(PoisonError::into_inner);
                    *proven = servers;
                    return Ok(answer);
                }
                () = tokio::time::sleep(patience), if !proven => patience *= 2,
                () = self.writer.matches().wait(|_| gone()) => {}
            }
        }
    }

    /// Whether all of them have answered.
    fn are_proven(&self, servers: &BTreeSet<GUID>) -> bool {
        self.proven.lock().unwrap_or_else(PoisonError::into_inner).is_superset(servers)
    }

    /// Waits for a server if there is none any more.
    async fn come_back(&self) -> Result<(), CallError> {
        let back = self.writer.matches().wait(|_| !self.servers().is_empty());
        tokio::time::timeout(ABSENCE, back)
            .await
            .map_err(|_| CallError::ServerLost { service: self.name.clone() })
    }

    fn transport(&self, message: String) -> CallError {
        CallError::Transport { service: self.name.clone(), message }
    }

    fn too_late(&self, attempts: u32, deadline: Duration) -> CallError {
        let service = self.name.clone();
        match attempts {
            0 => CallError::NoServer { service, domain: self.domain, deadline },
            attempts => CallError::NoAnswer { service, attempts, deadline },
        }
    }
}

async fn next(answers: &mut UnboundedReceiver<Raw>) -> Raw {
    match answers.recv().await {
        Some(raw) => raw,
        // Never: the caller holds a sender.
        None => std::future::pending().await,
    }
}

/// The numbers under which a call waits; taken back when it ends, however it ends.
struct PendingCall<'a> {
    inner: &'a Inner,
    sequences: Vec<i64>,
}

impl PendingCall<'_> {
    fn send(&mut self, payload: &[u8], sender: &UnboundedSender<Raw>) -> Result<(), CallError> {
        let inner = self.inner;
        let first = match inner.mapping {
            ServiceMapping::Enhanced => self.sequences.first().copied(),
            ServiceMapping::Cyclone => Some(
                *self
                    .sequences
                    .first()
                    .unwrap_or(&inner.sequence.fetch_add(1, Ordering::Relaxed).saturating_add(1)),
            ),
        };
        let (bytes, related) =
            wire::request(inner.mapping, payload, inner.writer.guid(), inner.reply_reader, first);
        // Locked while writing: an answer must not overtake the entry.
        let mut pending = inner.pending.lock().unwrap_or_else(PoisonError::into_inner);
        let identity =
            inner.writer.write(bytes, related).map_err(|message| inner.transport(message))?;
        let sequence = match inner.mapping {
            ServiceMapping::Enhanced => i64::from(identity.sequence_number),
            ServiceMapping::Cyclone => first.unwrap_or_default(),
        };
        pending.insert(sequence, sender.clone());
        self.sequences.push(sequence);
        Ok(())
    }
}

impl Drop for PendingCall<'_> {
    fn drop(&mut self) {
        let mut pending = self.inner.pending.lock().unwrap_or_else(PoisonError::into_inner);
        for sequence in &self.sequences {
            pending.remove(sequence);
        }
    }
}

/// Hands answers to the calls that wait for them.
async fn dispatch(reader: Reader, inner: std::sync::Weak<Inner>, stop: Stop, dropped: Stop) {
    while let Some(Some(sample)) = stop.or(dropped.or(reader.next())).await {
        let Some(inner) = inner.upgrade() else { return };
        let answer = sample.and_then(|sample| {
            wire::read_reply(inner.mapping, &sample, inner.writer.guid(), inner.reply_reader)
        });
        match answer {
            Ok(Some((sequence, raw))) => {
                let pending = inner.pending.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(sender) = pending.get(&sequence) {
                    // A call that has just been given up does not listen any more.
                    let _ = sender.send(raw);
                }
            }
            Ok(None) => {}
            Err(error) => tracing::warn!("{}: answer ignored: {error}", inner.name),
        }
    }
}
