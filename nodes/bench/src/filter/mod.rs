//! `puffer-bench filter`: how good the filtered cloud is, on simulated scans at their true poses.

mod case;
mod command;
mod row;

pub(crate) use command::FilterBenchmark;
