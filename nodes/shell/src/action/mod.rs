//! Actions: three services and two topics (<https://design.ros2.org/articles/actions.html>). Results are kept, so
//! that whoever asks for one gets it, also twice, and nothing waits for somebody to ask.

mod client;
mod goal;
mod goals;
mod server;

use crate::clock::Clock;
use crate::dds::Dds;
use crate::{ServiceMapping, Stop};
pub use client::{ActionClient, GoalHandle};
pub use goal::{Goal, Outcome};
use puffer_msgs::Action;
pub(crate) use server::serve;

/// Where an action's ends are made.
pub(crate) struct Place<'a> {
    pub dds: &'a Dds,
    pub mapping: ServiceMapping,
    pub domain: u16,
    /// Absolute.
    pub name: &'a str,
    pub clock: &'a Clock,
    pub stop: &'a Stop,
}

impl Place<'_> {
    /// Absolute name of one of the action's services and topics.
    fn part(&self, part: &str) -> String {
        format!("{}/_action/{part}", self.name)
    }
}

/// Name and type of the feedback topic on DDS.
fn feedback_topic<A: Action>(place: &Place<'_>) -> (String, String) {
    let kind = crate::dds::type_name(A::PACKAGE, "action", A::NAME, "_FeedbackMessage");
    (format!("rt{}", place.part("feedback")), kind)
}

type GoalId = [u8; 16];
