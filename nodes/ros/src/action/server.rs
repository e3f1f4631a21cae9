//! The server of an action.

use super::action_context::{ActionContext, GoalId, feedback_type};
use super::goal_table::{GoalTable, ResultReply};
use super::server_goal::{Goal, Outcome};
use crate::clock::Clock;
use crate::dds::Writer;
use crate::service::{Call, Server, answer_all};
use crate::{Publisher, Stamp, Stop, qos};
use anyhow::Result;
use puffer_msgs::action_msgs::msg::{GoalStatus, GoalStatusArray};
use puffer_msgs::action_msgs::srv::{CancelGoal, CancelGoalRequest, CancelGoalResponse};
use puffer_msgs::unique_identifier_msgs::msg::UUID;
use puffer_msgs::{Action, GetResultResponse, SendGoalRequest, SendGoalResponse};
use rustdds::policy::Durability;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Depth of the queue of feedback in DDS.
const FEEDBACK_QOS_DEPTH: i32 = 10;
/// How long a goal waits for its client to be matched with the feedback topic.
const MAX_FEEDBACK_MATCH_WAIT: Duration = Duration::from_millis(200);

/// Makes the action's services and topics and answers them until the node stops.
pub(crate) fn serve<A, C, H, F>(context: ActionContext<'_>, accept: C, execute: H) -> Result<()>
where
    A: Action,
    C: FnMut(&A::Goal) -> Result<(), String> + Send + 'static,
    H: FnMut(Goal<A>) -> F + Send + 'static,
    F: Future<Output = Outcome<A::Result>> + Send + 'static,
{
    let (dds, mapping) = (context.dds, context.mapping);
    let feedback_qos = qos::build(true, Durability::Volatile, FEEDBACK_QOS_DEPTH);
    let status_qos = qos::build(true, Durability::TransientLocal, 1);
    let server = Arc::new(ActionServer {
        name: context.name.to_owned(),
        goals: Mutex::new(GoalTable::new()),
        results: Server::new(dds, mapping, &context.endpoint_name("get_result"))?,
        feedback: Arc::new(dds.writer(
            &context.feedback_topic(),
            &feedback_type::<A>(),
            &feedback_qos,
        )?),
        status: Publisher::new(dds, &context.endpoint_name("status"), &status_qos)?,
        clock: context.clock.clone(),
        stop: context.stop.clone(),
    });
    let send_goal = Server::<A::SendGoal>::new(dds, mapping, &context.endpoint_name("send_goal"))?;
    let cancel_goal =
        Server::<CancelGoal>::new(dds, mapping, &context.endpoint_name("cancel_goal"))?;
    tokio::spawn(Arc::clone(&server).serve_goals(send_goal, accept, execute));
    let canceller = Arc::clone(&server);
    tokio::spawn(answer_all(
        cancel_goal,
        move |request| std::future::ready(canceller.cancel(&request)),
        context.stop.clone(),
    ));
    tokio::spawn(server.serve_results());
    Ok(())
}

/// What the tasks of an action server share.
struct ActionServer<A: Action> {
    name: String,
    goals: Mutex<GoalTable<A::Result, Call>>,
    results: Server<A::GetResult>,
    feedback: Arc<Writer>,
    status: Publisher<GoalStatusArray>,
    clock: Clock,
    stop: Stop,
}

impl<A: Action> ActionServer<A> {
    fn goals(&self) -> MutexGuard<'_, GoalTable<A::Result, Call>> {
        self.goals.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Answers the requests for new goals, and starts the work on those that are accepted.
    async fn serve_goals<C, H, F>(
        self: Arc<Self>,
        server: Server<A::SendGoal>,
        mut accept: C,
        mut execute: H,
    ) where
        C: FnMut(&A::Goal) -> Result<(), String> + Send + 'static,
        H: FnMut(Goal<A>) -> F + Send + 'static,
        F: Future<Output = Outcome<A::Result>> + Send + 'static,
    {
        while let Some((call, request)) = self.stop.or(server.receive()).await {
            let SendGoalRequest { goal_id: UUID { uuid: id }, goal } = request;
            let verdict = if self.goals().contains(id) {
                Err("a goal of the same number was sent before".to_owned())
            } else {
                accept(&goal)
            };
            let stamp = self.clock.now();
            let accepted = verdict.is_ok();
            let goal = match verdict {
                Ok(()) => Some(self.add_goal(id, goal, stamp)),
                Err(reason) => {
                    tracing::warn!("{}: goal refused: {reason}", self.name);
                    None
                }
            };
            server.answer(&call, &SendGoalResponse { accepted, stamp: stamp.into() }).await;
            if let Some(goal) = goal {
                self.match_feedback(&call).await;
                let cancel = goal.cancel_flag();
                let work = execute(goal);
                tokio::spawn(Arc::clone(&self).run(id, cancel, work));
            }
        }
    }

    /// Waits until the client receives feedback; otherwise the first feedback would be lost.
    async fn match_feedback(&self, call: &Call) {
        let writer = self.feedback.guid();
        let matched = self.feedback.matches().wait(|matches| {
            matches.remotes_of(writer).iter().any(|reader| call.is_from_participant_of(reader))
        });
        // A client without a reader of feedback is served all the same.
        let _ = tokio::time::timeout(MAX_FEEDBACK_MATCH_WAIT, matched).await;
    }

    /// Adds an accepted goal to the table.
    fn add_goal(&self, id: GoalId, goal: A::Goal, stamp: Stamp) -> Goal<A> {
        let cancel = self.stop.child();
        self.change(|goals| goals.accept(id, stamp, cancel.clone()));
        Goal::new(id, goal, cancel, Arc::clone(&self.feedback))
    }

    /// Runs the work on a goal and notes how it ended.
    async fn run(
        self: Arc<Self>,
        id: GoalId,
        cancel: Stop,
        work: impl Future<Output = Outcome<A::Result>> + Send + 'static,
    ) {
        self.change(|goals| goals.start(id));
        let outcome = tokio::spawn(work).await.unwrap_or_else(|error| {
            tracing::error!("{}: goal aborted: {error}", self.name);
            Outcome::Aborted(A::Result::default())
        });
        let (status, result) = match outcome {
            Outcome::Succeeded(result) => (GoalStatus::STATUS_SUCCEEDED, result),
            Outcome::Aborted(result) => (GoalStatus::STATUS_ABORTED, result),
            Outcome::Canceled(result) => (GoalStatus::STATUS_CANCELED, result),
        };
        // Ends the task that links this flag to the node's.
        cancel.stop();
        let response = GetResultResponse { status, result };
        for call in self.change(|goals| goals.end(id, &response)) {
            self.results.answer(&call, &response).await;
        }
    }

    /// Changes the goals and publishes the status of all.
    fn change<T>(&self, change: impl FnOnce(&mut GoalTable<A::Result, Call>) -> T) -> T {
        let mut goals = self.goals();
        let changed = change(&mut goals);
        // Locked while publishing: an older list must not be published after a newer one.
        if let Err(error) = self.status.publish(&goals.status()) {
            tracing::warn!("{error:#}");
        }
        changed
    }

    /// Answers a request to cancel goals.
    fn cancel(&self, request: &CancelGoalRequest) -> CancelGoalResponse {
        self.change(|goals| goals.cancel(request))
    }

    /// Answers the requests for results.
    async fn serve_results(self: Arc<Self>) {
        while let Some((call, request)) = self.stop.or(self.results.receive()).await {
            let answer = self.goals().request_result(request.goal_id.uuid, call);
            if let ResultReply::Now(call, response) = answer {
                self.results.answer(&call, &response).await;
            }
        }
    }
}
