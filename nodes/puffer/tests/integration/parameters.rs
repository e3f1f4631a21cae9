//! Parameters have one source: the struct fields.

use puffer_core::params::Parameters;
use puffer_core::pipeline::PipelineParams;
use serde_json::{Value, json};
use std::path::Path;

fn printed() -> String {
    crate::common::stdout(Path::new("."), &["params", "--yaml"])
}

#[test]
fn the_committed_file_is_what_the_program_prints() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/default.yaml");
    let committed = std::fs::read_to_string(path).unwrap_or_default();
    let same = committed == printed();
    assert!(same, "params/default.yaml is out of date: puffer params --yaml > params/default.yaml");
}

#[test]
fn the_committed_files_of_the_set_ups_are_what_the_program_prints() {
    for setup in puffer_core::robot::SETUP_NAMES {
        let path = format!("{}/../../params/{setup}.yaml", env!("CARGO_MANIFEST_DIR"));
        let committed = std::fs::read_to_string(path).unwrap_or_default();
        let call = ["params", "--setup", setup, "--yaml"];
        let same = committed == crate::common::stdout(Path::new("."), &call);
        assert!(same, "out of date: puffer params --setup {setup} --yaml > params/{setup}.yaml");
        let document: Value = serde_yaml_ng::from_str(&committed).unwrap();
        let driver = &document["mock_driver"]["ros__parameters"]["driver"];
        assert_eq!(driver["setup"], setup);
    }
}

#[test]
fn every_nodes_parameters_are_listed_and_described() {
    let listed = crate::common::json(Path::new("."), &["params", "--json"]);
    let listed = listed.as_array().unwrap();
    for node in [
        "mock_driver",
        "scan_registrar",
        "nbv_planner",
        "cloud_filter",
        "mesh_reconstructor",
        "modeller",
    ] {
        let own: Vec<&Value> = listed.iter().filter(|spec| spec["node"] == node).collect();
        assert!(own.len() > 3, "{node} has {} parameters", own.len());
        for spec in own {
            assert!(spec["description"].as_str().unwrap().len() > 5, "{spec}");
        }
        let text = crate::common::stdout(Path::new("."), &["params", "--node", node, "--yaml"]);
        let file: Value = serde_yaml_ng::from_str(&text).unwrap();
        assert_eq!(file.as_object().unwrap().keys().collect::<Vec<_>>(), [node]);
    }
    let laser = ["params", "--node", "nbv_planner", "--setup", "kr16_laser", "--json"];
    let laser = crate::common::json(Path::new("."), &laser);
    let support =
        laser.as_array().unwrap().iter().find(|spec| spec["name"] == "planner.support").unwrap();
    assert_eq!((&support["value"], &support["default"]), (&json!("table"), &json!("none")));
}

#[test]
fn the_printed_file_gives_the_defaults() {
    let document: Value = serde_yaml_ng::from_str(&printed()).unwrap();
    // From other values, so that a parameter left out of the file is noticed.
    let mut params = PipelineParams::default();
    let mut fields = 0;
    for spec in PipelineParams::all_specs() {
        let (group, field) = spec.name.split_once('.').unwrap();
        let other = match (spec.kind, spec.range) {
            ("boolean", _) => json!(!spec.default.as_bool().unwrap()),
            ("choice", _) => {
                spec.choices.iter().map(|c| json!(c)).find(|c| *c != spec.default).unwrap()
            }
            ("integer", Some([low, high])) if spec.default == json!(low as u64) => {
                json!(high as u64)
            }
            ("integer", Some([low, _])) => json!(low as u64),
            (_, Some([low, high])) if spec.default.as_f64() == Some(low) => json!(high),
            (_, Some([low, _])) => json!(low),
            _ => panic!("{}: no range", spec.name),
        };
        params.set_named(group, field, &other).unwrap();
        assert_eq!(document[group][field], spec.default, "{}", spec.name);
        fields += 1;
    }
    assert_ne!(params, PipelineParams::default());
    params.set_all(&document).unwrap();
    assert_eq!(params, PipelineParams::default());
    let in_file: usize =
        document.as_object().unwrap().values().map(|g| g.as_object().unwrap().len()).sum();
    assert_eq!(in_file, fields);
}

#[test]
fn every_parameter_is_described() {
    for spec in PipelineParams::all_specs() {
        assert!(spec.description.len() > 5, "{} has no description", spec.name);
    }
}
