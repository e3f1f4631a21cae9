//! The six parameter services, and `/parameter_events`.

use super::{Store, USE_SIM_TIME, values};
use crate::{Publisher, Stamp};
use puffer_core::params::{ParamSpec, Parameters};
use puffer_msgs::rcl_interfaces::msg::{
    ListParametersResult, Parameter, ParameterDescriptor, ParameterEvent, ParameterType,
    ParameterValue, SetParametersResult,
};
use puffer_msgs::rcl_interfaces::srv;
use serde_json::Value;
use std::sync::Arc;

/// Answers the parameter services of one node and tells changes.
pub(crate) struct Desk<P> {
    store: Arc<Store<P>>,
    node: String,
    events: Publisher<ParameterEvent>,
    now: Box<dyn Fn() -> Stamp + Send + Sync>,
}

/// Starts the services through `register`, which serves `node_name/service_name` with a function.
pub(crate) fn serve<P: Parameters>(
    node: &crate::Node<P>,
    store: &Arc<Store<P>>,
    events: Publisher<ParameterEvent>,
) -> anyhow::Result<()> {
    let clock = store.clock.clone();
    let desk = Arc::new(Desk {
        store: Arc::clone(store),
        node: node.full_name(),
        events,
        now: Box::new(move || clock.now()),
    });
    desk.tell(desk.store.all().into_iter().map(|(name, _)| name).collect(), true);
    macro_rules! serve {
        ($service:ident, $name:literal, $answer:ident) => {
            let own = Arc::clone(&desk);
            node.serve::<srv::$service, _, _>(concat!("~/", $name), move |request| {
                std::future::ready(own.$answer(request))
            })?;
        };
    }
    serve!(DescribeParameters, "describe_parameters", describe);
    serve!(GetParameters, "get_parameters", get);
    serve!(GetParameterTypes, "get_parameter_types", types);
    serve!(ListParameters, "list_parameters", list);
    serve!(SetParameters, "set_parameters", set);
    serve!(SetParametersAtomically, "set_parameters_atomically", set_atomically);
    Ok(())
}

fn specs<P: Parameters>() -> Vec<ParamSpec> {
    let mut specs = vec![ParamSpec {
        name: USE_SIM_TIME.to_owned(),
        kind: "boolean",
        default: Value::from(false),
        range: None,
        choices: &[],
        unit: "",
        description: "Take the time from /clock.".to_owned(),
    }];
    specs.extend(P::all_specs());
    specs
}

impl<P: Parameters> Desk<P> {
    fn describe(&self, request: srv::DescribeParametersRequest) -> srv::DescribeParametersResponse {
        let specs = specs::<P>();
        let describe = |name: String| match specs.iter().find(|spec| spec.name == name) {
            Some(spec) => values::descriptor(spec),
            None => ParameterDescriptor { name, ..Default::default() },
        };
        let descriptors = request.names.into_iter().map(describe).collect();
        srv::DescribeParametersResponse { descriptors }
    }

    fn value(&self, name: &str) -> ParameterValue {
        let kind = specs::<P>().into_iter().find(|spec| spec.name == name).map(|spec| spec.kind);
        match (kind, self.store.value(name)) {
            (Some(kind), Some(value)) => values::from_json(kind, &value),
            _ => ParameterValue::default(),
        }
    }

    fn get(&self, request: srv::GetParametersRequest) -> srv::GetParametersResponse {
        let values = request.names.iter().map(|name| self.value(name)).collect();
        srv::GetParametersResponse { values }
    }

    fn types(&self, request: srv::GetParameterTypesRequest) -> srv::GetParameterTypesResponse {
        let specs = specs::<P>();
        let kind = |name: &String| {
            let spec = specs.iter().find(|spec| spec.name == *name);
            spec.map_or(ParameterType::PARAMETER_NOT_SET, |spec| values::type_of(spec.kind))
        };
        srv::GetParameterTypesResponse { types: request.names.iter().map(kind).collect() }
    }

    fn list(&self, request: srv::ListParametersRequest) -> srv::ListParametersResponse {
        let names: Vec<String> = specs::<P>()
            .into_iter()
            .map(|spec| spec.name)
            .filter(|name| is_listed(name, &request.prefixes, request.depth))
            .collect();
        let mut prefixes: Vec<String> =
            names.iter().filter_map(|n| n.rsplit_once('.')).map(|(p, _)| p.to_owned()).collect();
        prefixes.dedup();
        srv::ListParametersResponse { result: ListParametersResult { names, prefixes } }
    }

    fn set(&self, request: srv::SetParametersRequest) -> srv::SetParametersResponse {
        let results = request.parameters.iter().map(|p| self.change(std::slice::from_ref(p)));
        srv::SetParametersResponse { results: results.collect() }
    }

    fn set_atomically(
        &self,
        request: srv::SetParametersAtomicallyRequest,
    ) -> srv::SetParametersAtomicallyResponse {
        srv::SetParametersAtomicallyResponse { result: self.change(&request.parameters) }
    }

    fn change(&self, parameters: &[Parameter]) -> SetParametersResult {
        match self.store.set(parameters) {
            Ok(()) => {
                self.tell(parameters.iter().map(|p| p.name.clone()).collect(), false);
                SetParametersResult { successful: true, reason: String::new() }
            }
            Err(reason) => SetParametersResult { successful: false, reason },
        }
    }

    fn tell(&self, names: Vec<String>, new: bool) {
        let values = names
            .into_iter()
            .map(|name| Parameter { value: self.value(&name), name })
            .collect::<Vec<_>>();
        let mut event = ParameterEvent {
            stamp: (self.now)().into(),
            node: self.node.clone(),
            ..Default::default()
        };
        *(if new { &mut event.new_parameters } else { &mut event.changed_parameters }) = values;
        if let Err(error) = self.events.publish(&event) {
            tracing::warn!("{error:#}");
        }
    }
}

/// As rclcpp: under one of the prefixes (all without any), at most `depth` words below it (0: any number).
fn is_listed(name: &str, prefixes: &[String], depth: u64) -> bool {
    let shallow = |rest: &str| depth == 0 || (rest.matches('.').count() as u64) < depth;
    if prefixes.is_empty() {
        return shallow(name);
    }
    prefixes.iter().any(|prefix| {
        name == prefix
            || name
                .strip_prefix(prefix.as_str())
                .and_then(|rest| rest.strip_prefix('.'))
                .is_some_and(shallow)
    })
}

#[cfg(test)]
mod tests {
    use super::is_listed;

    #[test]
    fn parameters_are_listed_by_prefix_and_depth() {
        let under = |prefix: &str| vec![prefix.to_owned()];
        assert!(is_listed("filter.radius", &[], 0) && is_listed("use_sim_time", &[], 1));
        assert!(!is_listed("filter.radius", &[], 1));
        assert!(is_listed("filter.radius", &under("filter"), 1));
        assert!(!is_listed("filter_b.radius", &under("filter"), 0));
        assert!(is_listed("filter.radius", &under("filter.radius"), 1));
    }
}
