//! `puffer params`: the parameter reference.

use crate::failure::usage;
use crate::table::print_rows;
use anyhow::Result;
use clap::Args;
use puffer_core::params::{ParamSpec, Parameters};
use puffer_core::pipeline;
use serde_json::{Value, json};

/// Default, range, unit and meaning of each parameter.
#[derive(Args)]
pub struct Params {
    /// Only the parameters of this stage
    #[arg(long, value_name = "STAGE")]
    node: Option<String>,
    /// Print a YAML file with all defaults, for --params
    #[arg(long)]
    yaml: bool,
    /// Print a JSON list
    #[arg(long, conflicts_with = "yaml")]
    json: bool,
}

impl Params {
    pub(super) fn run(&self) -> Result<()> {
        let specs = self.specs()?;
        if self.yaml {
            print!("{}", yaml(&specs));
        } else if self.json {
            println!("{}", Value::from(specs.iter().map(as_json).collect::<Vec<_>>()));
        } else {
            let rows = specs.iter().map(|s| {
                (s.name.clone(), format!("{:<16}  {}", s.default.to_string(), describe(s)))
            });
            print_rows(&rows.collect::<Vec<_>>());
        }
        Ok(())
    }

    fn specs(&self) -> Result<Vec<ParamSpec>> {
        let mut specs = pipeline::Params::all_specs();
        if let Some(node) = &self.node {
            let groups: Vec<String> = specs.iter().map(|s| group(s).to_owned()).collect();
            specs.retain(|s| group(s) == node);
            if specs.is_empty() {
                let mut known = groups;
                known.dedup();
                return Err(usage(format!("--node {node}: there is {}", known.join(", "))));
            }
        }
        Ok(specs)
    }
}

fn group(spec: &ParamSpec) -> &str {
    spec.name.split('.').next().unwrap_or_default()
}

fn describe(spec: &ParamSpec) -> String {
    let range = match (spec.range, spec.choices) {
        (Some([low, high]), _) => format!(
            " ({low} to {high}{}{})",
            if spec.unit.is_empty() { "" } else { " " },
            spec.unit
        ),
        (None, []) => String::new(),
        (None, choices) => format!(" ({})", choices.join(", ")),
    };
    format!("{}{range}", spec.description)
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

fn as_json(spec: &ParamSpec) -> Value {
    json!({
        "name": spec.name,
        "type": spec.kind,
        "default": spec.default,
        "range": spec.range,
        "choices": spec.choices,
        "unit": spec.unit,
        "description": spec.description,
    })
}
