//! `puffer params`: the parameter reference.

use crate::failure::usage;
use crate::nodes::{NODES, NodeKind};
use crate::setups::{self, Setting, describe, parameter_file, value_of};
use crate::table::{print_rows, print_text};
use anyhow::Result;
use clap::Args;
use puffer_core::params::{ParamSpec, Parameters};
use puffer_core::pipeline;
use serde_json::{Value, json};

/// Default, range, unit and meaning of each parameter: those of the stages, which `puffer reconstruct` and its like
/// take with --params and --set, and those of the nodes.
#[derive(Args)]
pub struct Params {
    /// Only the parameters of this stage (register, filter, reconstruct) or node
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
    /// The nodes' values in this set-up instead of the defaults
    #[arg(long, value_name = "NAME")]
    setup: Option<String>,
    /// Print a YAML file with all values: for --params of the stages; with --setup or a node, a ROS parameter file
    #[arg(long)]
    yaml: bool,
    /// Print a JSON list
    #[arg(long, conflicts_with = "yaml")]
    json: bool,
}

/// What is listed.
struct Listed {
    /// The stages' parameters.
    stages: Vec<ParamSpec>,
    nodes: Vec<&'static NodeKind>,
    settings: Vec<Setting>,
}

impl Params {
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

    fn listed(&self) -> Result<Listed> {
        let settings = match &self.setup {
            Some(setup) => setups::of(setup)?,
            None => Vec::new(),
        };
        let mut stages = pipeline::Params::all_specs();
        let mut nodes: Vec<&NodeKind> = NODES.iter().collect();
        if let Some(name) = &self.node {
            let mut known: Vec<String> = stages.iter().map(|s| group(s).to_owned()).collect();
            known.dedup();
            known.extend(nodes.iter().map(|kind| kind.name.to_owned()));
            stages.retain(|spec| group(spec) == name);
            nodes.retain(|kind| kind.name == name);
            if stages.is_empty() && nodes.is_empty() {
                return Err(usage(format!("--node {name}: there is {}", known.join(", "))));
            }
        }
        if self.setup.is_some() {
            stages.clear();
            if nodes.is_empty() {
                return Err(usage("--setup is about nodes, and --node names a stage"));
            }
        }
        Ok(Listed { stages, nodes, settings })
    }

    fn as_yaml(&self, listed: &Listed) -> String {
        if !listed.stages.is_empty() {
            return yaml(&listed.stages);
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

impl Listed {
    fn print(&self) {
        print_rows(&self.stages.iter().map(|spec| row(spec, &spec.default)).collect::<Vec<_>>());
        let mut first = self.stages.is_empty();
        for kind in &self.nodes {
            print_text(&format!("{}{}\n", if first { "" } else { "\n" }, kind.name));
            first = false;
            let specs = (kind.specs)();
            let rows = specs.iter().map(|s| row(s, value_of(s, kind.name, &self.settings)));
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

fn row(spec: &ParamSpec, value: &Value) -> (String, String) {
    (spec.name.clone(), format!("{:<16}  {}", value.to_string(), describe(spec)))
}

fn group(spec: &ParamSpec) -> &str {
    spec.name.split('.').next().unwrap_or_default()
}

/// All defaults with their descriptions as comments.
fn yaml(specs: &[ParamSpec]) -> String {
    let mut text = String::new();
    let mut current = "";
    for spec in specs {
        if group(spec) != current {
            current = group(spec);
            text += &format!("{current}:\n");
        }
        let field = spec.name.rsplit('.').next().unwrap_or_default();
        text += &format!("  # {}\n  {field}: {}\n", describe(spec), spec.default);
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
