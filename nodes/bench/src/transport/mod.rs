//! `puffer-bench transport`: the bulk transport between processes.

mod child_process;
mod command;
mod endpoint;
mod memory;
mod payload;
mod received_samples;
mod stream_report;

pub(crate) use command::TransportBenchmark;
pub(crate) use endpoint::Endpoint;
