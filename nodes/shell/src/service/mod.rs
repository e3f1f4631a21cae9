//! Services: servers that answer a repeated request once, clients with deadlines.

mod client;
mod server;
mod task;
mod wire;

pub use client::Client;
use puffer_msgs::Service;
pub(crate) use server::{Call, Server};
use std::time::Duration;
pub(crate) use task::answer_all;

/// As rmw_qos_profile_services_default.
const SERVICE_QOS_DEPTH: i32 = 10;

/// Names of the two types on DDS.
fn endpoint_types<S: Service>() -> (String, String) {
    let name = |suffix| crate::dds::type_name(S::PACKAGE, S::KIND, S::NAME, suffix);
    (name("_Request"), name("_Response"))
}

/// Why a call gave no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CallError {
    /// Nobody serves it.
    #[error(
        "no server for {service} within {:.1} s; does the node that serves it run, in DDS domain {domain} and \
         with the same RMW_IMPLEMENTATION?",
        deadline.as_secs_f64()
    )]
    NoServer {
        /// Absolute name of the service.
        service: String,
        /// DDS domain that was searched.
        domain: u16,
        /// How long was waited.
        deadline: Duration,
    },
    /// A server is there, but no answer came.
    #[error("{service} did not answer within {:.1} s (asked {attempts} times)", deadline.as_secs_f64())]
    NoAnswer {
        /// Absolute name of the service.
        service: String,
        /// How often the request was sent.
        attempts: u32,
        /// How long was waited.
        deadline: Duration,
    },
    /// The server went away during the call and did not come back.
    #[error("the server of {service} has gone during a call; has its node ended or crashed?")]
    ServerLost {
        /// Absolute name of the service.
        service: String,
    },
    /// A goal was accepted but has not ended.
    #[error("{action} has not ended within {:.1} s", deadline.as_secs_f64())]
    NoResult {
        /// Absolute name of the action.
        action: String,
        /// How long was waited.
        deadline: Duration,
    },
    /// The own node stops.
    #[error("call of {service} given up: the node stops")]
    Stopped {
        /// Absolute name of the service.
        service: String,
    },
    /// The request cannot be sent, or the answer not be read.
    #[error("{service}: {message}")]
    Transport {
        /// Absolute name of the service.
        service: String,
        /// What went wrong.
        message: String,
    },
}

impl CallError {
    /// The same with the deadline of the whole, of which the call was a part.
    pub(crate) fn within(mut self, whole: Duration) -> Self {
        if let CallError::NoServer { deadline, .. } | CallError::NoAnswer { deadline, .. } =
            &mut self
        {
            *deadline = whole;
        }
        self
    }
}
