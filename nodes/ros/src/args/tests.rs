use super::params_file;
use super::*;
use crate::names::Remap;
use anyhow::Result;
use serde_json::json;

fn parse(text: &str) -> Result<RosArgs> {
    RosArgs::parse_with(text.split(' ').map(str::to_owned), |_| None)
}

fn says(result: Result<impl std::fmt::Debug>, text: &str) {
    let error = format!("{:#}", result.unwrap_err());
    assert!(error.contains(text), "{error}");
}

#[test]
fn ros_arguments_end_at_two_dashes_and_leave_the_rest() {
    let args = parse(
        "--fast --ros-args -r points:=/cloud --remap planner:__node:=p -p a.b:=0.5 --log-level debug \
         --disable-rosout-logs -- file --ros-args -p planner:a.c:=[1,2] -r rostopic://x:=y",
    )
    .unwrap();
    assert_eq!(args.rest(), ["--fast", "file"]);
    assert_eq!(args.remaps[0], Remap { node: None, from: "points".into(), to: "/cloud".into() });
    assert_eq!(args.remaps[1].node.as_deref(), Some("planner"));
    assert_eq!(args.remaps[2].from, "rostopic://x");
    assert_eq!((args.settings[0].name.as_str(), &args.settings[0].value), ("a.b", &json!(0.5)));
    assert_eq!(args.settings[1].scope, Scope::Pattern("planner".into()));
    assert_eq!(args.settings[1].value, json!([1, 2]));
    assert_eq!(args.logs, LogOptions { level: "debug".into(), stdout: true, rosout: false });
}

#[test]
fn what_is_wrong_is_said_with_what_to_do() {
    says(parse("--ros-args --bogus"), "unknown ROS argument `--bogus`; known are");
    says(parse("--ros-args -r"), "-r needs a rule such as from:=to");
    says(parse("--ros-args -r points=cloud"), "expected from:=to");
    says(parse("--ros-args -p a.b"), "expected name:=value");
    says(parse("--ros-args -p a.b:=[1"), "not valid YAML");
    says(parse("--ros-args --log-level loud"), "the levels are debug");
    says(
        parse("--ros-args --params-file /nowhere.yaml"),
        "cannot read the parameter file /nowhere.yaml",
    );
}

fn with_variable(name: &str, value: &str) -> Result<RosArgs> {
    RosArgs::parse_with([], |asked| (asked == name).then(|| value.to_owned()))
}

fn mapping_of(rmw: &str) -> Result<ServiceMapping> {
    with_variable("RMW_IMPLEMENTATION", rmw).map(|args| args.mapping)
}

#[test]
fn the_environment_gives_domain_namespace_and_mapping() {
    assert_eq!(with_variable("ROS_DOMAIN_ID", "42").unwrap().domain(), 42);
    assert_eq!(with_variable("ROS_NAMESPACE", "/cell").unwrap().namespace, "/cell");
    says(with_variable("ROS_DOMAIN_ID", "233"), "ROS_DOMAIN_ID is `233`; allowed are 0 to 232");
    says(with_variable("ROS_DOMAIN_ID", "x"), "allowed are 0 to 232");
    assert_eq!(mapping_of("rmw_cyclonedds_cpp").unwrap(), ServiceMapping::Cyclone);
    assert_eq!(mapping_of("rmw_fastrtps_cpp").unwrap(), ServiceMapping::Enhanced);
    assert_eq!(mapping_of("").unwrap(), ServiceMapping::Enhanced);
    says(mapping_of("rmw_zenoh_cpp"), "does not speak");
}

/// The names of the parameters that are set for a node.
fn names_for<'a>(settings: &'a [Setting], node: &str) -> Vec<&'a str> {
    settings.iter().filter(|s| s.applies_to(node)).map(|s| s.name.as_str()).collect()
}

#[test]
fn a_parameter_file_names_nodes_and_nests_or_dots_its_values() {
    let text = "
/**:
  ros__parameters: {use_sim_time: true}
planner:
  ros__parameters:
    view: {gain: 0.5, method: thesis}
    view.steps: 3
cell:
  filter:
    ros__parameters: {filter.radius: 0.01}
/lab/*/filter:
  ros__parameters: {filter.radius: 0.02}
";
    let settings = params_file::parse(text, "test.yaml").unwrap();
    assert_eq!(
        names_for(&settings, "/planner"),
        ["use_sim_time", "view.gain", "view.method", "view.steps"]
    );
    assert_eq!(names_for(&settings, "/deep/planner").len(), 4);
    assert_eq!(names_for(&settings, "/cell/filter"), ["use_sim_time", "filter.radius"]);
    assert_eq!(names_for(&settings, "/lab/a/filter"), ["use_sim_time", "filter.radius"]);
    assert_eq!(names_for(&settings, "/filter"), ["use_sim_time"]);
    for setting in &settings {
        assert_eq!(
            setting.is_meant_exactly(),
            !["use_sim_time", "filter.radius"].contains(&&*setting.name)
                || setting.value == json!(0.01)
        );
    }
}

#[test]
fn a_file_of_another_shape_is_refused() {
    says(params_file::parse("a: [1, 2", "f"), "not valid YAML");
    says(
        params_file::parse("planner: {view: {gain: 1}}", "f"),
        "no `ros__parameters` under `planner/view/gain`",
    );
    says(params_file::parse("ros__parameters: {a: 1}", "f"), "at the top");
    says(params_file::parse("planner: {ros__parameters: 3}", "f"), "expected a map");
    assert!(params_file::parse("", "f").unwrap().is_empty());
}

#[test]
fn two_dashes_end_ros_arguments_only_where_they_have_begun() {
    let args = parse("-- a --ros-args -- b -- --ros-args --enable-rosout-logs").unwrap();
    assert_eq!(args.rest(), ["--", "a", "b", "--"]);
    assert!(RosArgs::parse_with([], |_| None).unwrap().rest().is_empty());
}

#[test]
fn log_options_of_rcl_are_accepted() {
    let args = parse(
        "--ros-args --log-level planner:=WARN --disable-stdout-logs --log-config-file a \
         --enable-external-lib-logs -e /enclave",
    )
    .unwrap();
    assert_eq!(args.logs, LogOptions { level: "warn".into(), stdout: false, rosout: true });
    says(parse("--ros-args -e"), "-e needs a value");
    says(parse("--ros-args --params-file"), "--params-file needs a file");
}

#[test]
fn a_rule_or_a_parameter_may_name_a_node() {
    for (rule, node, from) in [
        ("a:=b", None, "a"),
        ("planner:a:=b", Some("planner"), "a"),
        ("rosservice://~/a:=b", None, "rosservice://~/a"),
        ("planner:rostopic://a:=b", Some("planner"), "rostopic://a"),
    ] {
        let args = parse(&format!("--ros-args -r {rule}")).unwrap();
        assert_eq!((args.remaps[0].node.as_deref(), &*args.remaps[0].from), (node, from), "{rule}");
    }
    for rule in [":=b", "a:=", "a=b"] {
        says(parse(&format!("--ros-args -r {rule}")), "is no remapping rule");
    }
    says(parse("--ros-args -p :=1"), "sets no parameter");
    let text = parse("--ros-args -p a.b:=").unwrap();
    assert_eq!(text.settings[0].value, json!(null));
}

#[test]
fn what_the_program_sets_comes_before_what_the_user_wrote() {
    let args = parse("--ros-args -r __node:=user -p a.b:=1").unwrap();
    let args = args.with_name("own").with_param("a.b", 2).with_domain(7);
    assert_eq!((args.remaps[0].to.as_str(), args.remaps[1].to.as_str()), ("own", "user"));
    assert_eq!(args.settings[1].value, json!(2));
    assert_eq!(args.domain(), 7);
    assert_eq!(args.with_mapping(ServiceMapping::Cyclone).mapping, ServiceMapping::Cyclone);
}
