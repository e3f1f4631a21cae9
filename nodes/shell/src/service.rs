//! Services.

use crate::Service;
use std::marker::PhantomData;
use std::time::Duration;

/// Why a call gave no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CallError {
    /// Nobody serves it.
    #[error("no server for {service} within {:.1} s; is the node that serves it running, in domain {domain}?", deadline.as_secs_f64())]
    NoServer {
        /// Absolute name of the service.
        service: String,
        /// DDS domain that was searched.
        domain: u16,
        /// How long was waited.
        deadline: Duration,
    },
    /// A server is there, but no answer came.
    #[error("{service} did not answer within {:.1} s ({attempts} attempts); has the node that serves it died?", deadline.as_secs_f64())]
    NoAnswer {
        /// Absolute name of the service.
        service: String,
        /// How often the request was sent.
        attempts: u32,
        /// How long was waited.
        deadline: Duration,
    },
    /// The own node stops.
    #[error("call of {service} given up: the node stops")]
    Stopped {
        /// Absolute name of the service.
        service: String,
    },
    /// The request cannot be sent or the answer not be read.
    #[error("{service}: {message}")]
    Transport {
        /// Absolute name of the service.
        service: String,
        /// What went wrong.
        message: String,
    },
}

/// Calls a service; clones share it, and several calls may run at once.
#[derive(Clone)]
pub struct Client<S> {
    service: PhantomData<fn(S)>,
}

impl<S: Service> Client<S> {
    /// Waits for a server, asks it, and waits for the answer. The request is sent again when it seems lost
    /// (a server may see it twice only if the first answer was lost).
    ///
    /// # Errors
    /// No server or no answer within `deadline` (wall time), or the node stops.
    pub async fn call(
        &self,
        request: &S::Request,
        deadline: Duration,
    ) -> Result<S::Response, CallError> {
        let _ = request;
        Err(CallError::NoServer { service: String::new(), domain: 0, deadline })
    }

    /// Whether a server is matched now.
    pub fn is_ready(&self) -> bool {
        false
    }

    /// Absolute name of the service.
    pub fn name(&self) -> &str {
        ""
    }
}
