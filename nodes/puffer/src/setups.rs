//! The set-ups: which parameters differ from their defaults, and the parameter file of all nodes.

use crate::failure::usage;
use crate::nodes::{NodeKind, find};
use anyhow::{Context, Result};
use puffer_core::params::ParamSpec;
use puffer_core::robot::SETUPS;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::fmt::Write as _;

/// A parameter of a node that is not at its default.
pub(crate) struct Setting {
    pub node: &'static str,
    /// Group and field with a dot.
    pub name: Cow<'static, str>,
    pub value: Value,
}

fn all(nodes: &[&'static str], name: &'static str, value: Value) -> Vec<Setting> {
    nodes.iter().map(|node| Setting { node, name: name.into(), value: value.clone() }).collect()
}

/// The nodes that know how the robot's poses scatter and what is cut.
const SCAN: [&str; 3] = ["scan_registrar", "mesh_reconstructor", "modeller"];

/// The settings of a set-up; none if there is no such.
///
/// The standard deviations go with the robots' pose errors (lengths uniform between 0.1 and 0.3 mm and 0.01 and 0.03
/// degrees; 2 and 5 mm and 0.3 and 1 degree): a third of the mean square for each axis.
fn settings(setup: &str) -> Option<Vec<Setting>> {
    Some(match setup {
        "kr16_laser" => [
            all(&SCAN, "scan.pose_translation", json!(0.00012)),
            all(&SCAN, "scan.pose_rotation", json!(0.00021)),
            all(&SCAN, "scan.body_margin", json!(0.001)),
            all(&["nbv_planner"], "planner.sensor", json!("striper")),
            all(&["nbv_planner"], "planner.support", json!("table")),
            all(&["mesh_reconstructor"], "reconstruct.support", json!("table")),
            all(&["modeller"], "modeller.sensor", json!("laser")),
            all(&["modeller"], "modeller.support", json!("table")),
            all(&["mock_driver"], "driver.setup", json!("kr16_laser")),
        ]
        .into_iter()
        .flatten()
        .collect(),
        "omnirob_stereo" => [
            all(&SCAN, "scan.pose_translation", json!(0.0021)),
            all(&SCAN, "scan.pose_rotation", json!(0.0069)),
            all(&SCAN, "scan.body_margin", json!(0.005)),
            all(&["nbv_planner"], "planner.sensor", json!("stereo")),
            all(&["nbv_planner"], "planner.depth", json!(0.08)),
            all(&["modeller"], "modeller.sensor", json!("stereo")),
            all(&["mock_driver"], "driver.setup", json!("omnirob_stereo")),
        ]
        .into_iter()
        .flatten()
        .collect(),
        _ => return None,
    })
}

/// The settings of a set-up.
///
/// # Errors
/// There is no such: usage.
pub(crate) fn of(setup: &str) -> Result<Vec<Setting>> {
    settings(setup).ok_or_else(|| {
        usage(format!("there is no set-up {setup}; there are {}", SETUPS.join(", ")))
    })
}

/// The settings with which all files of a run go to `folder`.
pub(crate) fn output(folder: &str) -> Vec<Setting> {
    [
        all(&["mock_driver"], "driver.truth_folder", folder.into()),
        all(&["mesh_reconstructor"], "mesh.output_folder", folder.into()),
        all(&["modeller"], "modeller.run_folder", folder.into()),
        all(&["modeller"], "modeller.mesh_path", "mesh.ply".into()),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// What a parameter allows, in brackets, after its description.
pub(crate) fn describe(spec: &ParamSpec) -> String {
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

/// The value that a parameter of a node has with `settings`.
pub(crate) fn value_of<'a>(spec: &'a ParamSpec, node: &str, settings: &'a [Setting]) -> &'a Value {
    let set = settings.iter().rev().find(|s| s.node == node && s.name == spec.name);
    set.map_or(&spec.default, |s| &s.value)
}

/// The ROS parameter file of nodes: all their parameters, with `settings` in place of the defaults. `simulated` says
/// where time comes from; without it the file leaves that to whoever starts the nodes.
pub(crate) fn parameter_file<'a>(
    nodes: impl IntoIterator<Item = &'a NodeKind>,
    settings: &[Setting],
    simulated: Option<bool>,
) -> String {
    let mut text = String::new();
    for kind in nodes {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}:\n  ros__parameters:", kind.name);
        if let Some(simulated) = simulated {
            let _ = writeln!(text, "    use_sim_time: {simulated}");
        }
        let mut current = String::new();
        for spec in (kind.specs)() {
            let (group, field) = spec.name.split_once('.').unwrap_or(("", &spec.name));
            if group != current {
                current = group.to_owned();
                let _ = writeln!(text, "    {group}:");
            }
            let value = value_of(&spec, kind.name, settings);
            let _ = writeln!(text, "      # {}\n      {field}: {value}", describe(&spec));
        }
    }
    text
}

/// A setting as the user gives it: `NODE:GROUP.FIELD=VALUE`.
///
/// # Errors
/// What is wrong with it: usage.
pub(crate) fn parse(text: &str) -> Result<Setting> {
    let parts = text.split_once(':').and_then(|(node, rest)| Some((node, rest.split_once('=')?)));
    let Some((node, (name, value))) = parts else {
        return Err(usage(format!(
            "--set {text}: expected NODE:NAME=VALUE, such as nbv_planner:view.voxel_edge=0.003"
        )));
    };
    let Some(kind) = find(node) else {
        return Err(usage(format!("--set {text}: there is no node {node}")));
    };
    let Some(spec) = (kind.specs)().into_iter().find(|spec| spec.name == name) else {
        let known = (kind.specs)().iter().map(|s| s.name.clone()).collect::<Vec<_>>().join(", ");
        return Err(usage(format!("--set {text}: {node} has no parameter {name}; it has {known}")));
    };
    // What is no number and no boolean is a word.
    let value = serde_json::from_str(value).unwrap_or_else(|_| Value::from(value));
    Ok(Setting { node: kind.name, name: spec.name.into(), value })
}

/// Holds all settings against the parameters' types and ranges.
///
/// # Errors
/// The first that does not fit.
pub(crate) fn check(settings: &[Setting]) -> Result<()> {
    for Setting { node, name, value } in settings {
        let kind = find(node).ok_or_else(|| usage(format!("there is no node {node}")))?;
        let (group, field) = name.split_once('.').unwrap_or(("", name));
        (kind.check)(group, field, value).with_context(|| (*node).to_owned())?;
    }
    Ok(())
}
