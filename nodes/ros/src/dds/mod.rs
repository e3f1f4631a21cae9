//! The DDS participant of a node, and its readers and writers.

mod dds_names;
mod discovery_graph;
mod endpoints;
mod matched_endpoints;
mod participant;
mod serialized_payload;

pub(crate) use dds_names::{reply_topic, request_topic, ros_topic, type_name};
pub(crate) use endpoints::{Reader, Writer};
pub(crate) use matched_endpoints::MatchedEndpoints;
pub(crate) use participant::Participant;
pub(crate) use serialized_payload::{PayloadAdapter, ReceivedSample, SerializedPayload, encode};
