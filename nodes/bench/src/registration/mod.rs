//! `puffer-bench registration`: how far registered poses are from the truth, on simulated scans.

mod case;
mod command;
mod insertion_times;
mod outcome;
mod pair_trials;
mod recovery;
mod row;

pub(crate) use command::RegistrationBenchmark;
