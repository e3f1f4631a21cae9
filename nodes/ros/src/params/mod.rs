//! The parameters of a node: their values, the parameter services and `/parameter_events`.

mod no_params;
mod parameter_server;
mod parameter_store;
mod ros_parameters;
#[cfg(test)]
mod tests;

pub use no_params::NoParams;
pub(crate) use parameter_server::serve;
pub(crate) use parameter_store::ParameterStore;
