//! What can go wrong with a call.

use std::time::Duration;

/// Why a call of a service, or a goal of an action, gave no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CallError {
    /// No server was found.
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
        /// How long the call waited.
        deadline: Duration,
    },
    /// A server was found, but no answer came.
    #[error("{service} did not answer within {:.1} s (asked {attempts} times)", deadline.as_secs_f64())]
    NoAnswer {
        /// Absolute name of the service.
        service: String,
        /// How often the request was sent.
        attempts: u32,
        /// How long the call waited.
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
        /// How long the client waited.
        deadline: Duration,
    },
    /// The client's own node stops.
    #[error("call of {service} given up: the node stops")]
    Stopped {
        /// Absolute name of the service.
        service: String,
    },
    /// The request could not be sent, or the answer not be read.
    #[error("{service}: {message}")]
    Transport {
        /// Absolute name of the service.
        service: String,
        /// What went wrong.
        message: String,
    },
}

impl CallError {
    /// The same error with the deadline of the whole exchange, of which the call was a part.
    pub(crate) fn with_deadline(mut self, whole: Duration) -> Self {
        if let CallError::NoServer { deadline, .. } | CallError::NoAnswer { deadline, .. } =
            &mut self
        {
            *deadline = whole;
        }
        self
    }
}
