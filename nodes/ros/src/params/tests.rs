use super::parameter_store::ParameterStore;
use crate::RosArgs;

puffer_core::params! {
    /// For the tests.
    pub struct Reach("reach") {
        /// How far.
        far: f64 = 0.5, in [0.0, 1.0], unit "m";
        /// How often.
        often: usize = 3, in [1, 10];
    }
}

puffer_core::param_groups! {
    /// For the tests.
    pub struct Both {
        /// Reach.
        reach: Reach,
    }
}

fn store(args: &[&str]) -> anyhow::Result<ParameterStore<Both>> {
    let mut all = vec!["--ros-args".to_owned()];
    all.extend(args.iter().map(|arg| (*arg).to_owned()));
    let args = RosArgs::parse_with(all, |_| None)?;
    ParameterStore::new("/cell/arm", &args.settings)
}

#[test]
fn the_users_values_are_taken_and_mistakes_are_named() {
    let set =
        store(&["-p", "reach.far:=1", "-p", "use_sim_time:=true", "-p", "arm:reach.often:=4"]);
    let set = set.unwrap();
    assert_eq!(set.params().reach, Reach { far: 1.0, often: 4 });
    assert!(*set.watch_sim_time().borrow());
    assert_eq!(store(&["-p", "leg:reach.far:=7"]).unwrap().params().reach.far, 0.5);
    for (argument, says) in [
        (
            "reach.far:=7",
            "parameter reach.far: 7 is out of range; allowed are 0 to 1 (from -p reach.far:=7)",
        ),
        ("reach.near:=1", "reach.near: unknown; reach has far, often"),
        ("far:=1", "far: unknown; this node has reach.far, reach.often, use_sim_time"),
        ("use_sim_time:=7", "7 is not of type boolean"),
    ] {
        let error = store(&["-p", argument]).err().unwrap().to_string();
        assert!(error.contains(says) && error.contains("/cell/arm"), "{error}");
    }
}

fn write(path: &std::path::Path, text: &str) -> String {
    std::fs::write(path, text).unwrap();
    path.display().to_string()
}

#[test]
fn a_pattern_leaves_out_what_a_node_lacks_and_gives_way_to_the_nodes_own() {
    let dir = std::env::temp_dir().join(format!("puffer_ros_params_{}", std::process::id()));
    let file = write(
        &dir,
        "cell: {arm: {ros__parameters: {reach: {far: 0.25}}}}\n\
         /**: {ros__parameters: {reach: {far: 0.75, often: 5}, other: {x: 1}}}\n",
    );
    let set = store(&["--params-file", &file]).unwrap().params();
    assert_eq!(set.reach, Reach { far: 0.25, often: 5 });
    let file = write(&dir, "/**: {ros__parameters: {reach: {far: 5}}}\n");
    assert!(store(&["--params-file", &file]).err().unwrap().to_string().contains("out of range"));
    std::fs::remove_file(dir).unwrap();
}

#[test]
fn a_change_is_made_as_a_whole_or_not_at_all() {
    let store = store(&[]).unwrap();
    let before = store.params();
    let far = ("reach.far".to_owned(), 0.75.into());
    for (name, value) in [("reach.often", 99), ("reach.near", 1), ("near", 1)] {
        let change = [far.clone(), (name.to_owned(), value.into())];
        assert!(store.set(&change).is_err());
        assert_eq!(store.params(), before, "{name}");
    }
    let sim_time = ("use_sim_time".to_owned(), true.into());
    store.set(&[far.clone(), sim_time]).unwrap();
    assert_eq!(store.params().reach.far, 0.75);
    assert!(*store.watch_sim_time().borrow());
    assert_eq!(store.values().last().unwrap(), &("use_sim_time".to_owned(), true.into()));
}

#[test]
fn a_protected_parameter_keeps_its_value() {
    let store = store(&[]).unwrap();
    store.protect(&["reach.far"]);
    assert!(store.is_read_only("reach.far") && !store.is_read_only("reach.often"));
    let error = store.set(&[("reach.far".to_owned(), 0.75.into())]).unwrap_err();
    assert!(error.contains("read-only while the node runs"), "{error}");
    assert_eq!(store.params().reach.far, 0.5);
}

#[test]
fn parameters_of_rclcpp_are_ignored() {
    let set =
        store(&["-p", "qos_overrides./tf.depth:=7", "-p", "start_type_description_service:=false"]);
    assert_eq!(set.unwrap().params().reach.far, 0.5);
}

#[tokio::test]
async fn a_task_waits_for_a_change_of_a_value() {
    let store = store(&[]).unwrap();
    let seen = store.params();
    let setting = async {
        store.set(&[("reach.far".to_owned(), 0.5.into())]).unwrap();
        tokio::task::yield_now().await;
        store.set(&[("reach.often".to_owned(), 7.into())]).unwrap();
    };
    let (changed, ()) = tokio::join!(store.changed(&seen), setting);
    assert_eq!(changed.reach.often, 7, "the same value again is no change");
}
