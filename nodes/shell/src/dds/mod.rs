//! A DDS participant of its own for each node, and the endpoints on it.

mod graph;
mod matches;
mod raw;

use crate::Stop;
use anyhow::{Context, Result};
use futures::StreamExt;
use graph::Graph;
pub(crate) use matches::Matches;
pub(crate) use raw::{Raw, RawAdapter, Sample, encode};
use ros2_client::NodeName;
use rustdds::no_key::{DataWriter, SimpleDataReader};
use rustdds::policy::Durability;
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, GUID, QosPolicies, RTPSEntity,
    RepresentationIdentifier, SampleIdentity, StatusEvented, Timestamp, Topic, TopicKind,
    WriteOptionsBuilder,
};
use std::sync::{Arc, Mutex, PoisonError};

/// A participant with its publisher and subscriber.
pub(crate) struct Dds {
    participant: DomainParticipant,
    publisher: rustdds::Publisher,
    subscriber: rustdds::Subscriber,
    matches: Arc<Matches>,
    graph: Arc<Graph>,
    name: NodeName,
    foreign: Mutex<Option<ros2_client::Node>>,
}

impl Dds {
    /// Joins `domain`; must be called inside a tokio runtime. Its tasks end with `stop`.
    pub fn join(domain: u16, namespace: &str, name: &str, stop: &Stop) -> Result<Self> {
        let refused = || {
            format!(
                "cannot join DDS domain {domain}: is the network up, and are its UDP ports free?"
            )
        };
        let participant = DomainParticipantBuilder::new(domain).build().with_context(refused)?;
        let qos = QosPolicies::qos_none();
        let publisher = participant.create_publisher(&qos).with_context(refused)?;
        let subscriber = participant.create_subscriber(&qos).with_context(refused)?;
        let node_name =
            NodeName::new(namespace, name).with_context(|| format!("node name {name}"))?;
        let discovery = crate::qos::build(true, Durability::TransientLocal, 1);
        let topic = participant.create_topic(
            "ros_discovery_info".to_owned(),
            "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_".to_owned(),
            &discovery,
            TopicKind::NoKey,
        )?;
        let writer = publisher.create_datawriter_no_key::<Raw, RawAdapter>(&topic, None)?;
        let graph = Arc::new(Graph::new(participant.guid(), node_name.clone(), writer));
        let matches = Arc::new(Matches::new());
        tokio::spawn(watch_status(participant.clone(), Arc::clone(&matches), stop.clone()));
        let (announcer, ended) = (Arc::clone(&graph), stop.clone());
        tokio::spawn(async move { ended.or(announcer.run()).await });
        let foreign = Mutex::new(None);
        Ok(Self { participant, publisher, subscriber, matches, graph, name: node_name, foreign })
    }

    fn topic(&self, name: &str, type_name: &str, qos: &QosPolicies) -> Result<Topic> {
        self.participant
            .create_topic(name.to_owned(), type_name.to_owned(), qos, TopicKind::NoKey)
            .with_context(|| format!("cannot create the DDS topic {name}"))
    }

    /// `name` and `type_name` as DDS has them, such as "rt/points".
    pub fn writer(&self, name: &str, type_name: &str, qos: &QosPolicies) -> Result<Writer> {
        let topic = self.topic(name, type_name, qos)?;
        let inner = self
            .publisher
            .create_datawriter_no_key::<Raw, RawAdapter>(&topic, Some(qos.clone()))
            .with_context(|| format!("cannot write to the DDS topic {name}"))?;
        let endpoint = self.endpoint(inner.guid());
        self.graph.add_writer(endpoint.guid);
        Ok(Writer { inner, endpoint })
    }

    pub fn reader(&self, name: &str, type_name: &str, qos: &QosPolicies) -> Result<Reader> {
        let topic = self.topic(name, type_name, qos)?;
        let inner = self
            .subscriber
            .create_simple_datareader_no_key::<Raw, RawAdapter>(&topic, Some(qos.clone()))
            .with_context(|| format!("cannot read from the DDS topic {name}"))?;
        let endpoint = self.endpoint(inner.guid());
        self.graph.add_reader(endpoint.guid);
        Ok(Reader { inner, endpoint })
    }

    fn endpoint(&self, guid: GUID) -> Endpoint {
        Endpoint { guid, matches: Arc::clone(&self.matches), graph: Arc::clone(&self.graph) }
    }

    /// The participant itself.
    pub fn participant(&self) -> &DomainParticipant {
        &self.participant
    }

    /// Lends a ros2-client node on this participant, for endpoints that are made through that crate.
    pub fn with_ros2_node<T>(&self, make: impl FnOnce(&mut ros2_client::Node) -> T) -> Result<T> {
        let mut foreign = self.foreign.lock().unwrap_or_else(PoisonError::into_inner);
        let node = match foreign.as_mut() {
            Some(node) => node,
            None => {
                let context =
                    ros2_client::Context::from_domain_participant(self.participant.clone())?;
                let options = ros2_client::NodeOptions::new()
                    .enable_rosout(false)
                    .start_parameter_services(false);
                let node = context.new_node(self.name.clone(), options)?;
                self.graph.add_foreign(context);
                foreign.insert(node)
            }
        };
        let made = make(node);
        self.graph.refresh();
        Ok(made)
    }
}

async fn watch_status(participant: DomainParticipant, matches: Arc<Matches>, stop: Stop) {
    let listener = participant.status_listener();
    drop(participant);
    let mut events = listener.as_async_status_stream();
    while let Some(Some(event)) = stop.or(events.next()).await {
        matches.note(&event);
    }
}

/// What readers and writers have in common.
struct Endpoint {
    guid: GUID,
    matches: Arc<Matches>,
    graph: Arc<Graph>,
}

impl Drop for Endpoint {
    fn drop(&mut self) {
        self.graph.remove(self.guid);
        self.matches.forget(self.guid);
    }
}

pub(crate) struct Writer {
    inner: DataWriter<Raw, RawAdapter>,
    endpoint: Endpoint,
}

impl Writer {
    pub fn write(
        &self,
        body: Vec<u8>,
        related: Option<SampleIdentity>,
    ) -> Result<SampleIdentity, String> {
        let raw = Raw { body: body.into(), encoding: RepresentationIdentifier::CDR_LE };
        let options = WriteOptionsBuilder::new()
            .source_timestamp(Timestamp::now())
            .related_sample_identity_opt(related)
            .build();
        self.inner.write_with_options(raw, options).map_err(|error| match error {
            rustdds::dds::result::WriteError::WouldBlock { .. } => {
                "the queue stayed full for 100 ms: a reader does not keep up; the sample is dropped"
                    .to_owned()
            }
            other => other.to_string(),
        })
    }

    pub fn guid(&self) -> GUID {
        self.endpoint.guid
    }

    pub fn matches(&self) -> &Matches {
        &self.endpoint.matches
    }
}

pub(crate) struct Reader {
    inner: SimpleDataReader<Raw, RawAdapter>,
    endpoint: Endpoint,
}

impl Reader {
    /// The next sample; an error of the transport in words.
    pub async fn next(&self) -> Result<Sample, String> {
        let mut stream = std::pin::pin!(self.inner.as_async_stream());
        match stream.next().await {
            Some(Ok(change)) => Ok(sample(change)),
            Some(Err(error)) => Err(error.to_string()),
            None => std::future::pending().await,
        }
    }

    /// A sample that is there already.
    pub fn try_next(&self) -> Result<Option<Sample>, String> {
        self.inner.drain_read_notifications();
        self.inner.try_take_one().map(|taken| taken.map(sample)).map_err(|e| e.to_string())
    }

    pub fn guid(&self) -> GUID {
        self.endpoint.guid
    }

    pub fn matches(&self) -> &Matches {
        &self.endpoint.matches
    }
}

fn sample(change: rustdds::no_key::DeserializedCacheChange<Raw>) -> Sample {
    Sample {
        identity: SampleIdentity {
            writer_guid: change.writer_guid(),
            sequence_number: change.sequence_number,
        },
        related: change.related_sample_identity(),
        raw: change.into_value(),
    }
}

/// "sensor_msgs/msg/PointCloud2" as DDS has it, with something behind the name.
pub(crate) fn type_name(package: &str, kind: &str, name: &str, suffix: &str) -> String {
    format!("{package}::{kind}::dds_::{name}{suffix}_")
}
