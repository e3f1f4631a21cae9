use super::file::settings;
use super::*;
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

#[test]
fn the_environment_gives_domain_namespace_and_mapping() {
    let with = |name: &'static str, value: &'static str| {
        RosArgs::parse_with([], move |asked| (asked == name).then(|| value.to_owned()))
    };
    assert_eq!(with("ROS_DOMAIN_ID", "42").unwrap().domain(), 42);
    assert_eq!(with("ROS_NAMESPACE", "/cell").unwrap().namespace, "/cell");
    says(with("ROS_DOMAIN_ID", "233"), "ROS_DOMAIN_ID is `233`; allowed are 0 to 232");
    says(with("ROS_DOMAIN_ID", "x"), "allowed are 0 to 232");
    let mapping = |rmw| with("RMW_IMPLEMENTATION", rmw).map(|args| args.mapping);
    assert_eq!(mapping("rmw_cyclonedds_cpp").unwrap(), ServiceMapping::Cyclone);
    assert_eq!(mapping("rmw_fastrtps_cpp").unwrap(), ServiceMapping::Enhanced);
    assert_eq!(mapping("").unwrap(), ServiceMapping::Enhanced);
    says(mapping("rmw_zenoh_cpp"), "does not speak");
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
    let settings = settings(text, "test.yaml").unwrap();
    let names = |node: &str| -> Vec<_> {
        settings.iter().filter(|s| s.applies_to(node)).map(|s| s.name.as_str()).collect()
    };
    assert_eq!(names("/planner"), ["use_sim_time", "view.gain", "view.method", "view.steps"]);
    assert_eq!(names("/deep/planner").len(), 4);
    assert_eq!(names("/cell/filter"), ["use_sim_time", "filter.radius"]);
    assert_eq!(names("/lab/a/filter"), ["use_sim_time", "filter.radius"]);
    assert_eq!(names("/filter"), ["use_sim_time"]);
    let exact = |name| settings.iter().find(|s| s.name == name).unwrap().is_meant_exactly();
    assert!(!exact("use_sim_time") && exact("view.steps"));
}

#[test]
fn a_file_of_another_shape_is_refused() {
    says(settings("a: [1, 2", "f"), "not valid YAML");
    says(
        settings("planner: {view: {gain: 1}}", "f"),
        "no `ros__parameters` under `planner/view/gain`",
    );
    says(settings("ros__parameters: {a: 1}", "f"), "at the top");
    says(settings("planner: {ros__parameters: 3}", "f"), "expected a map");
    assert!(settings("", "f").unwrap().is_empty());
}
