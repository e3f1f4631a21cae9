//! The set-ups: which parameters differ from their defaults, and the parameter file of all nodes.

use crate::exit_status::usage_error;
use crate::nodes::{NodeKind, find_node};
use anyhow::{Context, Result};
use puffer_core::params::ParamSpec;
use puffer_core::robot::SETUP_NAMES;
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

/// One setting for each of `nodes`.
fn for_nodes(nodes: &[&'static str], name: &'static str, value: Value) -> Vec<Setting> {
    nodes.iter().map(|node| Setting { node, name: name.into(), value: value.clone() }).collect()
}

/// The nodes that know how exact the robot's poses are, and which points are cut.
const SCAN_NODES: [&str; 3] = ["scan_registrar", "mesh_reconstructor", "modeller"];

/// The settings of a set-up; `None` if there is no set-up of that name.
///
/// The standard deviations go with the robots' pose errors (lengths uniform between 0.1 and 0.3 mm
/// and 0.01 and 0.03 degrees; 2 and 5 mm and 0.3 and 1 degree): a third of the mean square for each
/// axis.
fn known_settings(setup: &str) -> Option<Vec<Setting>> {
    Some(match setup {
        "kr16_laser" => [
            for_nodes(&SCAN_NODES, "scan.pose_translation", json!(0.00012)),
            for_nodes(&SCAN_NODES, "scan.pose_rotation", json!(0.00021)),
            for_nodes(&SCAN_NODES, "scan.body_margin", json!(0.001)),
            for_nodes(&["nbv_planner"], "planner.sensor", json!("striper")),
            for_nodes(&["nbv_planner"], "planner.support", json!("table")),
            for_nodes(&["mesh_reconstructor"], "reconstruct.support", json!("table")),
            for_nodes(&["modeller"], "modeller.sensor", json!("laser")),
            for_nodes(&["modeller"], "modeller.support", json!("table")),
            for_nodes(&["mock_driver"], "driver.setup", json!("kr16_laser")),
        ]
        .into_iter()
        .flatten()
        .collect(),
        "omnirob_stereo" => [
            for_nodes(&SCAN_NODES, "scan.pose_translation", json!(0.0021)),
            for_nodes(&SCAN_NODES, "scan.pose_rotation", json!(0.0069)),
            for_nodes(&SCAN_NODES, "scan.body_margin", json!(0.005)),
            for_nodes(&["nbv_planner"], "planner.sensor", json!("stereo")),
            for_nodes(&["nbv_planner"], "planner.depth", json!(0.08)),
            for_nodes(&["modeller"], "modeller.sensor", json!("stereo")),
            for_nodes(&["mock_driver"], "driver.setup", json!("omnirob_stereo")),
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
/// Wrong usage if there is no set-up of that name.
pub(crate) fn setup_settings(setup: &str) -> Result<Vec<Setting>> {
    known_settings(setup).ok_or_else(|| {
        usage_error(format!("there is no set-up {setup}; there are {}", SETUP_NAMES.join(", ")))
    })
}

/// The settings with which all files of a run go to `folder`.
pub(crate) fn output_settings(folder: &str) -> Vec<Setting> {
    [
        for_nodes(&["mock_driver"], "driver.truth_folder", folder.into()),
        for_nodes(&["mesh_reconstructor"], "mesh.output_folder", folder.into()),
        for_nodes(&["modeller"], "modeller.run_folder", folder.into()),
        for_nodes(&["modeller"], "modeller.mesh_path", "mesh.ply".into()),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// What a parameter allows, in brackets, after its description.
pub(crate) fn describe_parameter(spec: &ParamSpec) -> String {
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

/// The ROS parameter file of nodes: all their parameters, with `settings` in place of the defaults.
/// `simulated` says where time comes from; without it the file leaves that to whoever starts the
/// nodes.
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
            let _ = writeln!(text, "      # {}\n      {field}: {value}", describe_parameter(&spec));
        }
    }
    text
}

/// A setting as the user gives it: `NODE:GROUP.FIELD=VALUE`.
///
/// # Errors
/// Wrong usage, with what is wrong.
pub(crate) fn parse_setting(text: &str) -> Result<Setting> {
    let parts = text.split_once(':').and_then(|(node, rest)| Some((node, rest.split_once('=')?)));
    let Some((node, (name, value))) = parts else {
        return Err(usage_error(format!(
            "--set {text}: expected NODE:NAME=VALUE, such as nbv_planner:view.voxel_edge=0.003"
        )));
    };
    let Some(kind) = find_node(node) else {
        return Err(usage_error(format!("--set {text}: there is no node {node}")));
    };
    let Some(spec) = (kind.specs)().into_iter().find(|spec| spec.name == name) else {
        let known = (kind.specs)().iter().map(|s| s.name.clone()).collect::<Vec<_>>().join(", ");
        return Err(usage_error(format!(
            "--set {text}: {node} has no parameter {name}; it has {known}"
        )));
    };
    // What is no number and no boolean is a word.
    let value = serde_json::from_str(value).unwrap_or_else(|_| Value::from(value));
    Ok(Setting { node: kind.name, name: spec.name.into(), value })
}

/// Checks all settings against the types and ranges of the parameters.
///
/// # Errors
/// The first that does not fit.
pub(crate) fn check_settings(settings: &[Setting]) -> Result<()> {
    for Setting { node, name, value } in settings {
        let kind =
            find_node(node).ok_or_else(|| usage_error(format!("there is no node {node}")))?;
        let (group, field) = name.split_once('.').unwrap_or(("", name));
        (kind.check)(group, field, value).with_context(|| (*node).to_owned())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_set_up_fits_the_parameters_of_the_nodes() {
        for setup in SETUP_NAMES {
            let settings = setup_settings(setup).unwrap();
            check_settings(&settings).unwrap();
            let driver = settings.iter().find(|s| s.name == "driver.setup").unwrap();
            assert_eq!((driver.node, driver.value.as_str()), ("mock_driver", Some(setup)));
        }
        check_settings(&output_settings("/tmp/run")).unwrap();
        let error = setup_settings("gantry").err().unwrap().to_string();
        assert!(error.contains("gantry") && error.contains("kr16_laser"), "{error}");
    }

    #[test]
    fn a_setting_is_parsed_and_checked_and_what_is_wrong_is_named() {
        let setting = parse_setting("nbv_planner:planner.margin=0.02").unwrap();
        assert_eq!((setting.node, &*setting.name), ("nbv_planner", "planner.margin"));
        assert_eq!(setting.value, 0.02);
        let word = parse_setting("nbv_planner:planner.sensor=stereo").unwrap();
        assert_eq!(word.value, "stereo");
        for (text, says) in [
            ("planner.margin=1", "expected NODE:NAME=VALUE"),
            ("planner:planner.margin=1", "there is no node planner"),
            ("nbv_planner:planner.speed=1", "no parameter planner.speed"),
        ] {
            let error = parse_setting(text).err().unwrap().to_string();
            assert!(error.contains(says), "{error}");
        }
        let wide = parse_setting("nbv_planner:planner.margin=7").unwrap();
        let error = format!("{:#}", check_settings(&[setting, wide]).unwrap_err());
        assert!(error.contains("nbv_planner") && error.contains("planner.margin"), "{error}");
    }

    #[test]
    fn the_parameter_file_holds_the_last_setting_of_each_parameter() {
        let node = find_node("modeller").unwrap();
        let settings = [
            parse_setting("modeller:session.max_scans=3").unwrap(),
            parse_setting("modeller:session.max_scans=7").unwrap(),
            parse_setting("mock_driver:driver.seed=9").unwrap(),
        ];
        let text = parameter_file([node], &settings, Some(true));
        let file: Value = serde_yaml_ng::from_str(&text).unwrap();
        let params = &file["modeller"]["ros__parameters"];
        assert_eq!(params["session"]["max_scans"], 7);
        assert_eq!(params["session"]["max_failed_moves"], 3);
        assert_eq!(params["use_sim_time"], true);
        assert_eq!(file.as_object().unwrap().len(), 1);
        assert!(!parameter_file([node], &settings, None).contains("use_sim_time"));
    }
}
