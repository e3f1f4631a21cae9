//! Services: clients with deadlines, which repeat a lost request, and servers that execute a
//! repeated request once.

mod call_error;
mod client;
mod correlation;
mod request_queue;
mod server;
mod service_endpoints;

pub use call_error::CallError;
pub use client::Client;
pub(crate) use request_queue::answer_all;
pub(crate) use server::{Call, Server};
