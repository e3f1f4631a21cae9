//! Actions between two nodes over DDS.

use crate::common::{SOON, free_domain, node};
use puffer_msgs::action::{Refine, RefineFeedback, RefineGoal, RefineResult};
use puffer_msgs::action_msgs::msg::{GoalStatus, GoalStatusArray};
use puffer_ros::{CallError, Goal, NoParams, Node, Outcome, QosProfile};
use std::time::Duration;

/// Ends well after one feedback, unless it is told to wait; then it ends when cancelled. Rejects a
/// third kind.
fn serve(node: &Node<NoParams>, kind: fn(&RefineGoal) -> Kind) {
    node.action_server::<Refine, _, _, _>(
        "~/refine",
        move |goal| match kind(goal) {
            Kind::Reject => Err("not now".to_owned()),
            _ => Ok(()),
        },
        move |goal| execute(goal, kind),
    )
    .unwrap();
}

async fn execute(goal: Goal<Refine>, kind: fn(&RefineGoal) -> Kind) -> Outcome<RefineResult> {
    goal.feedback(&RefineFeedback::default());
    let result = RefineResult { error_msg: "done".to_owned(), ..Default::default() };
    match kind(goal.request()) {
        Kind::Wait => {
            goal.cancelled().await;
            Outcome::Canceled(result)
        }
        Kind::Panic => panic!("on purpose"),
        Kind::Abort => Outcome::Aborted(result),
        _ => Outcome::Succeeded(result),
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Succeed,
    Abort,
    Wait,
    Reject,
    Panic,
}

async fn pair(kind: fn(&RefineGoal) -> Kind) -> (Node<NoParams>, Node<NoParams>) {
    let domain = free_domain();
    let server = node::<NoParams>("server", domain).await;
    serve(&server, kind);
    (server, node::<NoParams>("caller", domain).await)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_goal_gives_feedback_and_a_result_that_stays() {
    let (_server, caller) = pair(|_| Kind::Succeed).await;
    let mut statuses = caller
        .subscribe::<GoalStatusArray>("/server/refine/_action/status", QosProfile::LatchedSub)
        .unwrap();
    let client = caller.action_client::<Refine>("/server/refine").unwrap();
    let mut goal = client.send(&RefineGoal::default(), SOON).await.unwrap().unwrap();
    assert!(goal.feedback().await.is_some(), "the first feedback is lost");
    for _ in 0..2 {
        let outcome = goal.result(SOON).await.unwrap();
        assert!(matches!(outcome, Outcome::Succeeded(r) if r.error_msg == "done"));
    }
    while goal.feedback().await.is_some() {}
    assert!(!goal.cancel(SOON).await.unwrap());
    loop {
        let status = statuses.next_within(SOON).await.unwrap();
        if status.status_list.last().is_some_and(|s| s.status == GoalStatus::STATUS_SUCCEEDED) {
            break;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_question_for_the_result_is_answered() {
    use puffer_msgs::{Action, GetResultRequest, SendGoalRequest};
    let (_server, caller) = pair(|_| Kind::Abort).await;
    let send =
        caller.client::<<Refine as Action>::SendGoal>("/server/refine/_action/send_goal").unwrap();
    let ask = caller
        .client::<<Refine as Action>::GetResult>("/server/refine/_action/get_result")
        .unwrap();
    let mut goal = SendGoalRequest::<RefineGoal>::default();
    goal.goal_id.uuid = [7; 16];
    assert!(send.call(&goal, SOON).await.unwrap().accepted);
    assert!(!send.call(&goal, SOON).await.unwrap().accepted, "the same id again");
    let mut request = GetResultRequest::default();
    request.goal_id.uuid = [7; 16];
    for _ in 0..3 {
        let response = ask.call(&request, SOON).await.unwrap();
        assert_eq!(response.status, GoalStatus::STATUS_ABORTED);
        assert_eq!(response.result.error_msg, "done");
    }
    request.goal_id.uuid = [8; 16];
    let unknown = ask.call(&request, SOON).await.unwrap();
    assert_eq!(unknown.status, GoalStatus::STATUS_UNKNOWN);
}

#[tokio::test(flavor = "multi_thread")]
async fn several_goals_run_and_one_is_cancelled() {
    let (_server, caller) = pair(|_| Kind::Wait).await;
    let client = caller.action_client::<Refine>("/server/refine").unwrap();
    let first = client.send(&RefineGoal::default(), SOON).await.unwrap().unwrap();
    let second = client.send(&RefineGoal::default(), SOON).await.unwrap().unwrap();
    let error = second.result(Duration::from_millis(100)).await.unwrap_err();
    assert!(error.to_string().contains("/server/refine has not ended within 0.1 s"), "{error}");
    assert!(first.cancel(SOON).await.unwrap());
    assert!(matches!(first.result(SOON).await.unwrap(), Outcome::Canceled(_)));
    assert!(second.result(Duration::from_millis(100)).await.is_err());
    assert!(second.cancel(SOON).await.unwrap());
    assert!(matches!(second.result(SOON).await.unwrap(), Outcome::Canceled(_)));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_goal_can_be_rejected_and_a_panic_aborts_only_its_goal() {
    let (_rejecting, caller) = pair(|_| Kind::Reject).await;
    let client = caller.action_client::<Refine>("/server/refine").unwrap();
    assert!(client.send(&RefineGoal::default(), SOON).await.unwrap().is_none());
    let (_panicking, caller) = pair(|_| Kind::Panic).await;
    let client = caller.action_client::<Refine>("/server/refine").unwrap();
    for _ in 0..2 {
        let goal = client.send(&RefineGoal::default(), SOON).await.unwrap().unwrap();
        assert!(matches!(goal.result(SOON).await.unwrap(), Outcome::Aborted(_)));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_goes_ends_the_wait_with_its_name() {
    let (server, caller) = pair(|_| Kind::Wait).await;
    let client = caller.action_client::<Refine>("/server/refine").unwrap();
    let goal = client.send(&RefineGoal::default(), SOON).await.unwrap().unwrap();
    server.stop().stop();
    drop(server);
    let error = goal.result(SOON).await.unwrap_err();
    assert!(matches!(error, CallError::ServerLost { .. }), "{error}");
    assert!(error.to_string().contains("/server/refine"), "{error}");
    let error = client.send(&RefineGoal::default(), Duration::from_millis(200)).await;
    assert!(matches!(error, Err(CallError::NoServer { .. })));
}
