//! Whoever asks for a model hears what is missing, by the error's code too.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use puffer_msgs::action::{ModelObject, ModelObjectGoal, ModelObjectResult};
use puffer_ros::{NoParams, Node, Outcome, RosArgs, Stop, domain};
use std::time::Duration;

/// Long enough for a loaded machine.
const SOON: Duration = Duration::from_secs(60);

#[tokio::test(flavor = "multi_thread")]
async fn a_goal_without_driver_or_nodes_says_which_and_only_one_is_taken_at_a_time() {
    let domain = domain::find_free().unwrap();
    let stop = Stop::new();
    let words = ["--ros-args", "-p", "modeller.start_deadline:=2.0"].map(str::to_owned);
    let arguments = RosArgs::parse(words).unwrap().with_domain(domain);
    let modeller = tokio::spawn(modeller::run(arguments, stop.clone()));
    let arguments = || RosArgs::default().with_domain(domain);
    let caller = Node::<NoParams>::start("caller", arguments(), Stop::new()).await.unwrap();
    let ask = caller.action_client::<ModelObject>("model_object").unwrap();
    let refusal = async || {
        let handle = ask.send(&ModelObjectGoal::default(), SOON).await.unwrap().unwrap();
        let second = ask.send(&ModelObjectGoal::default(), SOON).await.unwrap();
        assert!(second.is_none(), "two goals at once");
        match handle.result(SOON).await.unwrap() {
            Outcome::Aborted(result) => (result.error_code, result.error_msg),
            other => panic!("{other:?}"),
        }
    };

    let (code, text) = refusal().await;
    assert_eq!(code, ModelObjectResult::NO_DRIVER, "{text}");
    assert!(text.contains("trigger_scan") && text.contains("nbv_planner"), "{text}");

    let driver = tokio::spawn(mock_driver::run(arguments(), stop.clone()));
    let (code, text) = loop {
        let (code, text) = refusal().await;
        if !text.contains("trigger_scan") && !text.contains("controller") {
            break (code, text);
        }
    };
    assert_eq!(code, ModelObjectResult::NODE_MISSING, "{text}");
    assert!(text.contains("scan_registrar") && text.contains("cloud_filter"), "{text}");

    stop.stop();
    modeller.await.unwrap().unwrap();
    driver.await.unwrap().unwrap();
}
