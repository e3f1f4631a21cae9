//! The parameter services of rcl_interfaces, and `/parameter_events`.

use super::parameter_store::ParameterStore;
use super::ros_parameters;
use crate::clock::Clock;
use crate::{Node, Publisher};
use anyhow::Result;
use puffer_core::params::Parameters;
use puffer_msgs::Service;
use puffer_msgs::rcl_interfaces::msg::{
    ListParametersResult, Parameter, ParameterDescriptor, ParameterEvent, ParameterValue,
    SetParametersResult,
};
use puffer_msgs::rcl_interfaces::srv;
use std::collections::BTreeSet;
use std::sync::Arc;

/// What the parameter services share.
struct ParameterServer<P> {
    store: Arc<ParameterStore<P>>,
    events: Publisher<ParameterEvent>,
    clock: Clock,
    full_name: String,
}

/// Serves the six parameter services of rcl_interfaces; changes are published by `events`.
pub(crate) fn serve<P: Parameters>(
    node: &Node<P>,
    store: &Arc<ParameterStore<P>>,
    clock: Clock,
    events: Publisher<ParameterEvent>,
) -> Result<()> {
    let store = Arc::clone(store);
    let server = Arc::new(ParameterServer { store, events, clock, full_name: node.full_name() });
    let shared = Arc::clone(&server);
    serve_with::<P, srv::ListParameters>(node, "~/list_parameters", move |request| {
        srv::ListParametersResponse { result: shared.list(&request.prefixes, request.depth) }
    })?;
    let shared = Arc::clone(&server);
    serve_with::<P, srv::GetParameters>(node, "~/get_parameters", move |request| {
        srv::GetParametersResponse {
            values: request.names.iter().map(|n| shared.value(n)).collect(),
        }
    })?;
    let shared = Arc::clone(&server);
    serve_with::<P, srv::GetParameterTypes>(node, "~/get_parameter_types", move |request| {
        let types = request.names.iter().map(|name| shared.value(name).r#type).collect();
        srv::GetParameterTypesResponse { types }
    })?;
    let shared = Arc::clone(&server);
    serve_with::<P, srv::DescribeParameters>(node, "~/describe_parameters", move |request| {
        let descriptors = request.names.iter().map(|name| shared.describe(name)).collect();
        srv::DescribeParametersResponse { descriptors }
    })?;
    let shared = Arc::clone(&server);
    serve_with::<P, srv::SetParameters>(node, "~/set_parameters", move |request| {
        let results = request.parameters.iter().map(|p| shared.set(std::slice::from_ref(p)));
        srv::SetParametersResponse { results: results.collect() }
    })?;
    serve_with::<P, srv::SetParametersAtomically>(
        node,
        "~/set_parameters_atomically",
        move |request| srv::SetParametersAtomicallyResponse {
            result: server.set(&request.parameters),
        },
    )
}

/// Serves a service with a function that answers at once.
fn serve_with<P: Parameters, S: Service>(
    node: &Node<P>,
    name: &str,
    mut function: impl FnMut(S::Request) -> S::Response + Send + 'static,
) -> Result<()> {
    node.serve::<S, _, _>(name, move |request| std::future::ready(function(request)))
}

impl<P: Parameters> ParameterServer<P> {
    /// The value of a parameter; "not set" if the node has none of the name.
    fn value(&self, name: &str) -> ParameterValue {
        let values = self.store.values();
        let spec = ParameterStore::<P>::specs().into_iter().find(|spec| spec.name == name);
        let value = values.iter().find(|(known, _)| known == name);
        match (spec, value) {
            (Some(spec), Some((_, value))) => ros_parameters::to_ros(&spec, value),
            _ => ParameterValue::default(),
        }
    }

    /// The descriptor of a parameter; only a name if the node has none of the name.
    fn describe(&self, name: &str) -> ParameterDescriptor {
        let spec = ParameterStore::<P>::specs().into_iter().find(|spec| spec.name == name);
        match spec {
            Some(spec) => ros_parameters::describe(&spec, self.store.is_read_only(name)),
            None => ParameterDescriptor { name: name.to_owned(), ..Default::default() },
        }
    }

    /// Sets all of the parameters or none, and announces the change.
    fn set(&self, parameters: &[Parameter]) -> SetParametersResult {
        let changes = parameters
            .iter()
            .map(|p| {
                ros_parameters::from_ros(&p.name, &p.value).map(|value| (p.name.clone(), value))
            })
            .collect::<Result<Vec<_>, _>>();
        match changes.and_then(|changes| self.store.set(&changes)) {
            Ok(()) => {
                self.announce(parameters);
                SetParametersResult { successful: true, reason: String::new() }
            }
            Err(reason) => SetParametersResult { successful: false, reason },
        }
    }

    /// Publishes the parameters as changed.
    fn announce(&self, parameters: &[Parameter]) {
        let changed = parameters
            .iter()
            .map(|p| Parameter { name: p.name.clone(), value: self.value(&p.name) })
            .collect();
        let event = ParameterEvent {
            stamp: self.clock.now().into(),
            node: self.full_name.clone(),
            changed_parameters: changed,
            ..Default::default()
        };
        if let Err(error) = self.events.publish(&event) {
            tracing::warn!(node = %self.full_name, "parameter event lost: {error:#}");
        }
    }

    /// Lists as rclcpp does the names below the prefixes (all if there is none) that have at most
    /// `depth` words below their prefix (0: any number).
    fn list(&self, prefixes: &[String], depth: u64) -> ListParametersResult {
        let names: Vec<_> = ParameterStore::<P>::specs()
            .into_iter()
            .map(|spec| spec.name)
            .filter(|name| is_listed(name, prefixes, depth))
            .collect();
        let groups: BTreeSet<_> = names
            .iter()
            .filter_map(|name| name.rsplit_once('.'))
            .map(|(group, _)| group.to_owned())
            .collect();
        ListParametersResult { names, prefixes: groups.into_iter().collect() }
    }
}

/// Whether a parameter is below one of the prefixes, and not deeper than `depth` words below it.
fn is_listed(name: &str, prefixes: &[String], depth: u64) -> bool {
    if prefixes.is_empty() {
        return has_depth(name, depth);
    }
    prefixes.iter().any(|prefix| {
        name == prefix
            || name
                .strip_prefix(prefix.as_str())
                .and_then(|rest| rest.strip_prefix('.'))
                .is_some_and(|rest| has_depth(rest, depth))
    })
}

/// Whether a name has at most `depth` words (0: any number).
fn has_depth(name: &str, depth: u64) -> bool {
    depth == 0 || (name.split('.').count() as u64) <= depth
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes_and_depth_choose_names_as_in_rclcpp() {
        let names = ["use_sim_time", "scan.radius", "scan.cut.margin", "scanner.rate"];
        for (prefix, depth, listed) in [
            ("", 0, &[0, 1, 2, 3][..]),
            ("", 1, &[0]),
            ("", 2, &[0, 1, 3]),
            ("scan", 0, &[1, 2]),
            ("scan", 1, &[1]),
            ("scan.cut", 1, &[2]),
            ("use_sim_time", 1, &[0]),
            ("sc", 0, &[]),
        ] {
            let prefixes: Vec<String> =
                [prefix.to_owned()].into_iter().filter(|p| !p.is_empty()).collect();
            let found: Vec<usize> =
                (0..names.len()).filter(|i| is_listed(names[*i], &prefixes, depth)).collect();
            assert_eq!(found, listed, "{prefix} {depth}");
        }
    }
}
