//! A DDS participant.

use super::discovery_graph::DiscoveryGraph;
use super::endpoints::{Endpoint, Reader, Writer};
use super::matched_endpoints::MatchedEndpoints;
use super::serialized_payload::{PayloadAdapter, SerializedPayload};
use crate::Stop;
use anyhow::{Context, Result};
use futures::StreamExt;
use ros2_client::NodeName;
use rustdds::policy::Durability;
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, GUID, QosPolicies, RTPSEntity, StatusEvented,
    Topic, TopicKind,
};
use std::sync::{Arc, Mutex, PoisonError};

/// A DDS participant with its publisher and subscriber; each node has one of its own.
pub(crate) struct Participant {
    participant: DomainParticipant,
    publisher: rustdds::Publisher,
    subscriber: rustdds::Subscriber,
    matches: Arc<MatchedEndpoints>,
    graph: Arc<DiscoveryGraph>,
    name: NodeName,
    /// The node that [`Participant::with_ros2_node`] lends.
    ros2_node: Mutex<Option<ros2_client::Node>>,
}

impl Participant {
    /// Joins `domain` as the node `namespace`/`name`; must be called inside a tokio runtime. Its
    /// tasks end with `stop`.
    pub fn join(domain: u16, namespace: &str, name: &str, stop: &Stop) -> Result<Self> {
        let participant =
            DomainParticipantBuilder::new(domain).build().with_context(|| join_error(domain))?;
        let qos = QosPolicies::qos_none();
        let publisher = participant.create_publisher(&qos).with_context(|| join_error(domain))?;
        let subscriber = participant.create_subscriber(&qos).with_context(|| join_error(domain))?;
        let node_name =
            NodeName::new(namespace, name).with_context(|| format!("node name {name}"))?;
        let discovery = crate::qos::build(true, Durability::TransientLocal, 1);
        let topic = participant.create_topic(
            "ros_discovery_info".to_owned(),
            "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_".to_owned(),
            &discovery,
            TopicKind::NoKey,
        )?;
        let writer = publisher
            .create_datawriter_no_key::<SerializedPayload, PayloadAdapter>(&topic, None)?;
        let graph = Arc::new(DiscoveryGraph::new(participant.guid(), node_name.clone(), writer));
        let matches = Arc::new(MatchedEndpoints::new());
        tokio::spawn(watch_status(participant.clone(), Arc::clone(&matches), stop.clone()));
        let (announcer, ended) = (Arc::clone(&graph), stop.clone());
        tokio::spawn(async move { ended.or(announcer.run()).await });
        let ros2_node = Mutex::new(None);
        Ok(Self { participant, publisher, subscriber, matches, graph, name: node_name, ros2_node })
    }

    fn topic(&self, name: &str, type_name: &str, qos: &QosPolicies) -> Result<Topic> {
        self.participant
            .create_topic(name.to_owned(), type_name.to_owned(), qos, TopicKind::NoKey)
            .with_context(|| format!("cannot create the DDS topic {name}"))
    }

    /// A writer; `name` and `type_name` are those of DDS, such as "rt/points" and
    /// "sensor_msgs::msg::dds_::PointCloud2_".
    pub fn writer(&self, name: &str, type_name: &str, qos: &QosPolicies) -> Result<Writer> {
        let topic = self.topic(name, type_name, qos)?;
        let inner = self
            .publisher
            .create_datawriter_no_key::<SerializedPayload, PayloadAdapter>(
                &topic,
                Some(qos.clone()),
            )
            .with_context(|| format!("cannot write to the DDS topic {name}"))?;
        let endpoint = self.endpoint(inner.guid());
        self.graph.add_writer(endpoint.guid);
        Ok(Writer { inner, endpoint })
    }

    /// A reader; `name` and `type_name` as for [`Participant::writer`].
    pub fn reader(&self, name: &str, type_name: &str, qos: &QosPolicies) -> Result<Reader> {
        let topic = self.topic(name, type_name, qos)?;
        let inner = self
            .subscriber
            .create_simple_datareader_no_key::<SerializedPayload, PayloadAdapter>(
                &topic,
                Some(qos.clone()),
            )
            .with_context(|| format!("cannot read from the DDS topic {name}"))?;
        let endpoint = self.endpoint(inner.guid());
        self.graph.add_reader(endpoint.guid);
        Ok(Reader { inner, endpoint })
    }

    fn endpoint(&self, guid: GUID) -> Endpoint {
        Endpoint { guid, matches: Arc::clone(&self.matches), graph: Arc::clone(&self.graph) }
    }

    /// Which remote endpoints those of this participant are matched with.
    pub fn matches(&self) -> &MatchedEndpoints {
        &self.matches
    }

    /// The participant of rustdds.
    pub fn dds_participant(&self) -> &DomainParticipant {
        &self.participant
    }

    /// Lends a ros2-client node on this participant to `make`, for endpoints that are made through
    /// that crate.
    pub fn with_ros2_node<T>(&self, make: impl FnOnce(&mut ros2_client::Node) -> T) -> Result<T> {
        let mut ros2_node = self.ros2_node.lock().unwrap_or_else(PoisonError::into_inner);
        let node = match ros2_node.as_mut() {
            Some(node) => node,
            None => {
                let context =
                    ros2_client::Context::from_domain_participant(self.participant.clone())?;
                let options = ros2_client::NodeOptions::new()
                    .enable_rosout(false)
                    .start_parameter_services(false);
                let node = context.new_node(self.name.clone(), options)?;
                self.graph.set_ros2_context(context);
                ros2_node.insert(node)
            }
        };
        let made = make(node);
        self.graph.refresh();
        Ok(made)
    }
}

async fn watch_status(participant: DomainParticipant, matches: Arc<MatchedEndpoints>, stop: Stop) {
    let listener = participant.status_listener();
    drop(participant);
    let mut events = listener.as_async_status_stream();
    while let Some(Some(event)) = stop.or(events.next()).await {
        matches.on_status_event(&event);
    }
}

fn join_error(domain: u16) -> String {
    format!("cannot join DDS domain {domain}: is the network up, and are its UDP ports free?")
}
