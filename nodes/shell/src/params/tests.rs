use super::store::Store;
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

fn store(args: &[&str]) -> anyhow::Result<Store<Both>> {
    let mut all = vec!["--ros-args".to_owned()];
    all.extend(args.iter().map(|arg| (*arg).to_owned()));
    let args = RosArgs::parse_with(all, |_| None)?;
    Store::new("/cell/arm", &args.settings)
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

#[test]
fn a_pattern_leaves_out_what_a_node_lacks_and_gives_way_to_the_nodes_own() {
    let dir = std::env::temp_dir().join(format!("puffer_shell_params_{}", std::process::id()));
    let write = |text: &str| {
        std::fs::write(&dir, text).unwrap();
        dir.display().to_string()
    };
    let file = write(
        "cell: {arm: {ros__parameters: {reach: {far: 0.25}}}}\n\
         /**: {ros__parameters: {reach: {far: 0.75, often: 5}, other: {x: 1}}}\n",
    );
    let set = store(&["--params-file", &file]).unwrap().params();
    assert_eq!(set.reach, Reach { far: 0.25, often: 5 });
    let file = write("/**: {ros__parameters: {reach: {far: 5}}}\n");
    assert!(store(&["--params-file", &file]).err().unwrap().to_string().contains("out of range"));
    std::fs::remove_file(dir).unwrap();
}
