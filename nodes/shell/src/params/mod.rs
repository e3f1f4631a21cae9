//! Parameter services and `/parameter_events`.

mod convert;
mod none;
mod store;
#[cfg(test)]
mod tests;

use crate::clock::Clock;
use crate::{Node, Publisher};
use anyhow::Result;
pub use none::NoParams;
use puffer_core::params::Parameters;
use puffer_msgs::Service;
use puffer_msgs::rcl_interfaces::msg::{
    ListParametersResult, Parameter, ParameterDescriptor, ParameterEvent, ParameterValue,
    SetParametersResult,
};
use puffer_msgs::rcl_interfaces::srv;
use std::collections::BTreeSet;
use std::sync::Arc;
pub(crate) use store::Store;

/// A store with what announces its changes.
struct Board<P> {
    store: Arc<Store<P>>,
    events: Publisher<ParameterEvent>,
    clock: Clock,
    full_name: String,
}

/// Serves the six services of rcl_interfaces, and tells changes by `events`.
pub(crate) fn serve<P: Parameters>(
    node: &Node<P>,
    store: &Arc<Store<P>>,
    clock: Clock,
    events: Publisher<ParameterEvent>,
) -> Result<()> {
    let store = Arc::clone(store);
    let board = Arc::new(Board { store, events, clock, full_name: node.full_name() });
    let b = Arc::clone(&board);
    answer::<P, srv::ListParameters>(node, "~/list_parameters", move |request| {
        srv::ListParametersResponse { result: b.list(&request.prefixes, request.depth) }
    })?;
    let b = Arc::clone(&board);
    answer::<P, srv::GetParameters>(node, "~/get_parameters", move |request| {
        srv::GetParametersResponse { values: request.names.iter().map(|n| b.value(n)).collect() }
    })?;
    let b = Arc::clone(&board);
    answer::<P, srv::GetParameterTypes>(node, "~/get_parameter_types", move |request| {
        let types = request.names.iter().map(|name| b.value(name).r#type).collect();
        srv::GetParameterTypesResponse { types }
    })?;
    let b = Arc::clone(&board);
    answer::<P, srv::DescribeParameters>(node, "~/describe_parameters", move |request| {
        let descriptors = request.names.iter().map(|name| b.describe(name)).collect();
        srv::DescribeParametersResponse { descriptors }
    })?;
    let b = Arc::clone(&board);
    answer::<P, srv::SetParameters>(node, "~/set_parameters", move |request| {
        let results = request.parameters.iter().map(|p| b.set(std::slice::from_ref(p)));
        srv::SetParametersResponse { results: results.collect() }
    })?;
    answer::<P, srv::SetParametersAtomically>(node, "~/set_parameters_atomically", move |request| {
        srv::SetParametersAtomicallyResponse { result: board.set(&request.parameters) }
    })
}

/// Serves with a function that answers at once.
fn answer<P: Parameters, S: Service>(
    node: &Node<P>,
    name: &str,
    mut function: impl FnMut(S::Request) -> S::Response + Send + 'static,
) -> Result<()> {
    node.serve::<S, _, _>(name, move |request| std::future::ready(function(request)))
}

impl<P: Parameters> Board<P> {
    fn value(&self, name: &str) -> ParameterValue {
        let values = self.store.values();
        let spec = Store::<P>::specs().into_iter().find(|spec| spec.name == name);
        let value = values.iter().find(|(known, _)| known == name);
        match (spec, value) {
            (Some(spec), Some((_, value))) => convert::to_ros(&spec, value),
            _ => ParameterValue::default(),
        }
    }

    fn describe(&self, name: &str) -> ParameterDescriptor {
        let spec = Store::<P>::specs().into_iter().find(|spec| spec.name == name);
        match spec {
            Some(spec) => convert::describe(&spec, self.store.is_read_only(name)),
            None => ParameterDescriptor { name: name.to_owned(), ..Default::default() },
        }
    }

    fn set(&self, parameters: &[Parameter]) -> SetParametersResult {
        let changes = parameters
            .iter()
            .map(|p| convert::from_ros(&p.name, &p.value).map(|value| (p.name.clone(), value)))
            .collect::<Result<Vec<_>, _>>();
        match changes.and_then(|changes| self.store.set(&changes)) {
            Ok(()) => {
                self.announce(parameters);
                SetParametersResult { successful: true, reason: String::new() }
            }
            Err(reason) => SetParametersResult { successful: false, reason },
        }
    }

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

    /// As rclcpp: names below the prefixes (all if there is none), at most `depth` words below them (0: any).
    fn list(&self, prefixes: &[String], depth: u64) -> ListParametersResult {
        let within = |name: &str| {
            let deep = |rest: &str| depth == 0 || (rest.split('.').count() as u64) <= depth;
            if prefixes.is_empty() {
                return deep(name);
            }
            prefixes.iter().any(|prefix| {
                name == prefix
                    || name
                        .strip_prefix(prefix.as_str())
                        .and_then(|rest| rest.strip_prefix('.'))
                        .is_some_and(deep)
            })
        };
        let names: Vec<_> = Store::<P>::specs()
            .into_iter()
            .map(|spec| spec.name)
            .filter(|name| within(name))
            .collect();
        let groups: BTreeSet<_> = names
            .iter()
            .filter_map(|name| name.rsplit_once('.'))
            .map(|(group, _)| group.to_owned())
            .collect();
        ListParametersResult { names, prefixes: groups.into_iter().collect() }
    }
}
