//! The client of a service.

use super::CallError;
use super::correlation;
use super::service_endpoints::{SERVICE_QOS_DEPTH, reply_type, request_type};
use crate::dds::{
    MatchedEndpoints, Participant, Reader, SerializedPayload, Writer, encode, reply_topic,
    request_topic,
};
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

/// How long the first attempt waits for an answer before the request is sent again, as long as the
/// client and the server have not worked together before; doubled with each attempt. The first
/// request after matching can get lost, because discovery tells one side before the other.
const FIRST_REPLY_TIMEOUT: Duration = Duration::from_secs(1);
/// How long a server that has just been found is given to find this client.
const DISCOVERY_DELAY: Duration = Duration::from_millis(100);
/// How long a server may be away during a call (it restarts) before the call is given up.
const MAX_SERVER_ABSENCE: Duration = Duration::from_secs(3);

/// Calls the service `S`. Clones share the client, and several calls may run at once.
///
/// It is made by [`Node::client`](crate::Node::client).
///
/// ```no_run
/// # use puffer_ros::{NoParams, Node};
/// # use puffer_msgs::std_srvs::srv::{SetBool, SetBoolRequest};
/// # use std::time::Duration;
/// # async fn example(node: &Node<NoParams>) -> anyhow::Result<()> {
/// let client = node.client::<SetBool>("/light/switch")?;
/// let answer = client.call(&SetBoolRequest { data: true }, Duration::from_secs(5)).await?;
/// assert!(answer.success, "{}", answer.message);
/// # Ok(())
/// # }
/// ```
pub struct Client<S> {
    inner: Arc<ClientState>,
    service: PhantomData<fn(S)>,
}

impl<S> Clone for Client<S> {
    fn clone(&self) -> Self {
        Self { inner: Arc::clone(&self.inner), service: PhantomData }
    }
}

struct ClientState {
    name: String,
    domain: u16,
    mapping: ServiceMapping,
    writer: Writer,
    reply_reader: GUID,
    /// The calls that wait for an answer, by the sequence numbers of their requests.
    pending: Mutex<BTreeMap<i64, UnboundedSender<SerializedPayload>>>,
    sequence: AtomicI64,
    /// The servers that have answered before.
    proven: Mutex<BTreeSet<GUID>>,
    stop: Stop,
    /// Ends the task that receives answers.
    dropped: Stop,
}

impl Drop for ClientState {
    fn drop(&mut self) {
        self.dropped.stop();
    }
}

impl<S: Service> Client<S> {
    /// A client of the service with the absolute name `name`.
    pub(crate) fn new(
        dds: &Participant,
        mapping: ServiceMapping,
        domain: u16,
        name: &str,
        stop: &Stop,
    ) -> Result<Self> {
        let qos = crate::qos::service(SERVICE_QOS_DEPTH);
        let reader = dds.reader(&reply_topic(name), &reply_type::<S>(), &qos)?;
        let inner = Arc::new(ClientState {
            name: name.to_owned(),
            domain,
            mapping,
            writer: dds.writer(&request_topic(name), &request_type::<S>(), &qos)?,
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

    /// Waits for a server, sends it the request, and waits for the answer; several calls may run at
    /// once. A request that seems lost is sent again under the same number, and servers of this
    /// crate execute it once only; another server may see it twice, and only as long as it has not
    /// answered this client before.
    ///
    /// # Errors
    /// No server or no answer within `deadline` (wall time), a server that dies, or the own node
    /// stops.
    pub async fn call(
        &self,
        request: &S::Request,
        deadline: Duration,
    ) -> Result<S::Response, CallError> {
        let inner = &self.inner;
        let payload = encode(request).map_err(|message| inner.transport_error(message))?;
        let attempts = AtomicU32::new(0);
        let exchange = tokio::time::timeout(deadline, async {
            inner.wait_for_any_server().await;
            inner.exchange(&payload, &attempts).await
        });
        let payload = match inner.stop.or(exchange).await {
            None => return Err(CallError::Stopped { service: inner.name.clone() }),
            Some(Ok(answer)) => answer?,
            Some(Err(_)) => return Err(inner.deadline_error(attempts.into_inner(), deadline)),
        };
        payload.decode().map_err(|message| inner.transport_error(message))
    }

    /// Calls a server that is known to be there, and waits without a deadline.
    ///
    /// # Errors
    /// As [`Client::call`], except for the deadline.
    pub(crate) async fn call_known(&self, request: &S::Request) -> Result<S::Response, CallError> {
        let inner = &self.inner;
        let payload = encode(request).map_err(|message| inner.transport_error(message))?;
        let attempts = AtomicU32::new(0);
        match inner.stop.or(inner.exchange(&payload, &attempts)).await {
            None => Err(CallError::Stopped { service: inner.name.clone() }),
            Some(reply) => reply?.decode().map_err(|message| inner.transport_error(message)),
        }
    }

    /// Whether DDS has matched a server with this client.
    pub fn is_ready(&self) -> bool {
        !self.inner.servers().is_empty()
    }

    /// The matches of this and all other endpoints of the node.
    pub(crate) fn matches(&self) -> &MatchedEndpoints {
        self.inner.writer.matches()
    }

    /// The service's absolute name.
    pub fn name(&self) -> &str {
        &self.inner.name
    }
}

impl ClientState {
    /// The reply writers of the servers that are matched in both directions.
    fn servers(&self) -> BTreeSet<GUID> {
        let matches = self.writer.matches();
        let request_readers = matches.remotes_of(self.writer.guid());
        let mut servers = matches.remotes_of(self.reply_reader);
        servers
            .retain(|server| request_readers.iter().any(|reader| reader.prefix == server.prefix));
        servers
    }

    /// Resolves when there is a server.
    async fn wait_for_any_server(&self) {
        self.writer.matches().wait(|_| !self.servers().is_empty()).await;
    }

    /// Resolves when one of `servers` is gone, or there was none.
    async fn wait_for_loss_of(&self, servers: &BTreeSet<GUID>) {
        let matches = self.writer.matches();
        matches.wait(|_| servers.is_empty() || !self.servers().is_superset(servers)).await;
    }

    /// Sends a request, repeats it while it seems lost, and returns the answer; counts the
    /// attempts.
    async fn exchange(
        &self,
        payload: &[u8],
        attempts: &AtomicU32,
    ) -> Result<SerializedPayload, CallError> {
        let (sender, mut answers) = unbounded_channel();
        let mut call = PendingCall { inner: self, sequences: Vec::new() };
        let mut reply_timeout = FIRST_REPLY_TIMEOUT;
        if !self.are_proven(&self.servers()) {
            tokio::time::sleep(DISCOVERY_DELAY).await;
        }
        loop {
            self.wait_for_return().await?;
            let servers = self.servers();
            call.send(payload, &sender)?;
            attempts.fetch_add(1, Ordering::Relaxed);
            let proven = self.are_proven(&servers);
            tokio::select! {
                answer = receive(&mut answers) => {
                    let mut proven = self.proven.lock().unwrap_or_else(PoisonError::into_inner);
                    *proven = servers;
                    return Ok(answer);
                }
                () = tokio::time::sleep(reply_timeout), if !proven => reply_timeout *= 2,
                () = self.wait_for_loss_of(&servers) => {}
            }
        }
    }

    /// Whether all of `servers` have answered before.
    fn are_proven(&self, servers: &BTreeSet<GUID>) -> bool {
        self.proven.lock().unwrap_or_else(PoisonError::into_inner).is_superset(servers)
    }

    /// Waits for the server to come back if there is none any more.
    async fn wait_for_return(&self) -> Result<(), CallError> {
        tokio::time::timeout(MAX_SERVER_ABSENCE, self.wait_for_any_server())
            .await
            .map_err(|_| CallError::ServerLost { service: self.name.clone() })
    }

    fn transport_error(&self, message: String) -> CallError {
        CallError::Transport { service: self.name.clone(), message }
    }

    fn deadline_error(&self, attempts: u32, deadline: Duration) -> CallError {
        let service = self.name.clone();
        match attempts {
            0 => CallError::NoServer { service, domain: self.domain, deadline },
            attempts => CallError::NoAnswer { service, attempts, deadline },
        }
    }
}

async fn receive(answers: &mut UnboundedReceiver<SerializedPayload>) -> SerializedPayload {
    match answers.recv().await {
        Some(answer) => answer,
        // Never: the caller holds a sender.
        None => std::future::pending().await,
    }
}

/// The sequence numbers under which a call waits; taken back when it ends, however it ends.
struct PendingCall<'a> {
    inner: &'a ClientState,
    sequences: Vec<i64>,
}

impl PendingCall<'_> {
    /// Sends the request once; `sender` gets the answer.
    fn send(
        &mut self,
        payload: &[u8],
        sender: &UnboundedSender<SerializedPayload>,
    ) -> Result<(), CallError> {
        let inner = self.inner;
        let first = match inner.mapping {
            ServiceMapping::Enhanced => self.sequences.first().copied(),
            ServiceMapping::Cyclone => {
                let next = inner.sequence.fetch_add(1, Ordering::Relaxed).saturating_add(1);
                Some(self.sequences.first().copied().unwrap_or(next))
            }
        };
        let (bytes, related) = correlation::request(
            inner.mapping,
            payload,
            inner.writer.guid(),
            inner.reply_reader,
            first,
        );
        // Locked while writing: an answer must not overtake the entry.
        let mut pending = inner.pending.lock().unwrap_or_else(PoisonError::into_inner);
        let identity =
            inner.writer.write(bytes, related).map_err(|message| inner.transport_error(message))?;
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
async fn dispatch(reader: Reader, inner: std::sync::Weak<ClientState>, stop: Stop, dropped: Stop) {
    while let Some(Some(sample)) = stop.or(dropped.or(reader.next())).await {
        let Some(inner) = inner.upgrade() else { return };
        let answer = sample.and_then(|sample| {
            correlation::read_reply(inner.mapping, &sample, inner.writer.guid(), inner.reply_reader)
        });
        match answer {
            Ok(Some((sequence, payload))) => {
                let pending = inner.pending.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(sender) = pending.get(&sequence) {
                    // Fails only if the call has just been given up.
                    let _ = sender.send(payload);
                }
            }
            Ok(None) => {}
            Err(error) => tracing::warn!("{}: answer ignored: {error}", inner.name),
        }
    }
}
