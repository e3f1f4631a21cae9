//! What the endpoints of an action are made from.

use crate::clock::Clock;
use crate::dds::{Participant, ros_topic, type_name};
use crate::{ServiceMapping, Stop};
use puffer_msgs::Action;

/// The identity of a goal, a UUID that its client chooses.
pub(super) type GoalId = [u8; 16];

/// An action's name, and the parts of the node that its endpoints are made from.
pub(crate) struct ActionContext<'a> {
    pub dds: &'a Participant,
    pub mapping: ServiceMapping,
    pub domain: u16,
    /// The action's absolute name.
    pub name: &'a str,
    pub clock: &'a Clock,
    pub stop: &'a Stop,
}

impl ActionContext<'_> {
    /// Absolute name of the action's service or topic `part`.
    pub(super) fn endpoint_name(&self, part: &str) -> String {
        format!("{}/_action/{part}", self.name)
    }

    /// DDS name of the action's feedback topic.
    pub(super) fn feedback_topic(&self) -> String {
        ros_topic(&self.endpoint_name("feedback"))
    }
}

/// DDS name of the type of an action's feedback messages.
pub(super) fn feedback_type<A: Action>() -> String {
    type_name(A::PACKAGE, "action", A::NAME, "_FeedbackMessage")
}
