//! `puffer params`: the parameter reference.

use crate::exit_status::usage_error;
use crate::nodes::{NODES, NodeKind};
use crate::setups::{self, Setting, describe_parameter, parameter_file, value_of};
use crate::table::{print_rows, print_text};
use anyhow::Result;
use clap::Args;
use puffer_core::params::{ParamSpec, Parameters};
use puffer_core::pipeline;
use serde_json::{Value, json};

/// Default, range, unit and meaning of each parameter: those of the stages, which `puffer
/// reconstruct` and its like take with --params and --set, and those of the nodes.
#[derive(Args)]
pub struct ParamsCommand {
    /// Only the parameters of this stage (register, filter, reconstruct) or node
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
    /// The nodes' values in this set-up instead of the defaults
    #[arg(long, value_name = "NAME")]
    setup: Option<String>,
    /// Print a YAML file with all values: for --params of the stages; with --setup or a node, a ROS
    /// parameter file
    #[arg(long)]
    yaml: bool,
    /// Print a JSON list
    #[arg(long, conflicts_with = "yaml")]
    json: bool,
}

/// What is listed.
struct ParameterList {
    /// The stages' parameters.
    stages: Vec<ParamSpec>,
    nodes: Vec<&'static NodeKind>,
    settings: Vec<Setting>,
}

impl ParamsCommand {
    pub(super) fn run(&self) -> Result<()> {
        let listed = self.listed()?;
        if self.yaml {
            print_text(&self.as_yaml(&listed));
        } else if self.json {
            print_text(&format!("{}\n", listed.as_json()));
        } else {
            listed.print();
        }
        Ok(())
    }

    fn listed(&self) -> Result<ParameterList> {
        let settings = match &self.setup {
            Some(setup) => setups::setup_settings(setup)?,
            None => Vec::new(),
        };
        let mut stages = pipeline::PipelineParams::all_specs();
        let mut nodes: Vec<&NodeKind> = NODES.iter().collect();
        if let Some(name) = &self.node {
            let mut known: Vec<String> = stages.iter().map(|s| group_of(s).to_owned()).collect();
            known.dedup();
            known.extend(nodes.iter().map(|kind| kind.name.to_owned()));
            stages.retain(|spec| group_of(spec) == name);
            nodes.retain(|kind| kind.name == name);
            if stages.is_empty() && nodes.is_empty() {
                return Err(usage_error(format!("--node {name}: there is {}", known.join(", "))));
            }
        }
        if self.setup.is_some() {
            stages.clear();
            if nodes.is_empty() {
                return Err(usage_error("--setup is about nodes, and --node names a stage"));
            }
        }
        Ok(ParameterList { stages, nodes, settings })
    }

    fn as_yaml(&self, listed: &ParameterList) -> String {
        if !listed.stages.is_empty() {
            return defaults_yaml(&listed.stages);
        }
        let call: String = [("--setup", &self.setup), ("--node", &self.node)]
            .iter()
            .filter_map(|(flag, value)| value.as_ref().map(|value| format!(" {flag} {value}")))
            .collect();
        let nodes = listed.nodes.iter().copied();
        format!(
            "# Made by `puffer params{call} --yaml`. Whoever starts the nodes sets use_sim_time.\n{}",
            parameter_file(nodes, &listed.settings, None)
        )
    }
}

impl ParameterList {
    fn print(&self) {
        print_rows(
            &self.stages.iter().map(|spec| parameter_row(spec, &spec.default)).collect::<Vec<_>>(),
        );
        let mut first = self.stages.is_empty();
        for kind in &self.nodes {
            print_text(&format!("{}{}\n", if first { "" } else { "\n" }, kind.name));
            first = false;
            let specs = (kind.specs)();
            let rows =
                specs.iter().map(|s| parameter_row(s, value_of(s, kind.name, &self.settings)));
            print_rows(&rows.collect::<Vec<_>>());
        }
    }

    fn as_json(&self) -> Value {
        let mut all: Vec<Value> =
            self.stages.iter().map(|spec| as_json(spec, None, &spec.default)).collect();
        for kind in &self.nodes {
            let specs = (kind.specs)();
            all.extend(specs.iter().map(|spec| {
                as_json(spec, Some(kind.name), value_of(spec, kind.name, &self.settings))
            }));
        }
        Value::from(all)
    }
}

fn parameter_row(spec: &ParamSpec, value: &Value) -> (String, String) {
    (spec.name.clone(), format!("{:<16}  {}", value.to_string(), describe_parameter(spec)))
}

fn group_of(spec: &ParamSpec) -> &str {
    spec.name.split('.').next().unwrap_or_default()
}

/// All defaults with their descriptions as comments.
fn defaults_yaml(specs: &[ParamSpec]) -> String {
    let mut text = String::new();
    let mut current = "";
    for spec in specs {
        if group_of(spec) != current {
            current = group_of(spec);
            text += &format!("{current}:\n");
        }
        let field = spec.name.rsplit('.').next().unwrap_or_default();
        text += &format!("  # {}\n  {field}: {}\n", describe_parameter(spec), spec.default);
    }
    text
}

/// `node` is none for the stages' parameters.
fn as_json(spec: &ParamSpec, node: Option<&str>, value: &Value) -> Value {
    json!({
        "node": node,
        "name": spec.name,
        "type": spec.kind,
        "default": spec.default,
        "value": value,
        "range": spec.range,
        "choices": spec.choices,
        "unit": spec.unit,
        "description": spec.description,
    })
}
