//! The serving end of an action.

use super::goal::{Goal, Outcome};
use super::goals::{Answer, Goals};
use super::{GoalId, Place, feedback_topic};
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

const FEEDBACK_DEPTH: i32 = 10;
/// How long a goal waits for its client to be matched with the feedback topic.
const FEEDBACK_WAIT: Duration = Duration::from_millis(200);

/// Makes the action's services and topics and answers them until the node stops.
pub(crate) fn serve<A, C, H, F>(place: Place<'_>, accept: C, execute: H) -> Result<()>
where
    A: Action,
    C: FnMut(&A::Goal) -> Result<(), String> + Send + 'static,
    H: FnMut(Goal<A>) -> F + Send + 'static,
    F: Future<Output = Outcome<A::Result>> + Send + 'static,
{
    let (dds, mapping) = (place.dds, place.mapping);
    let (topic, kind) = feedback_topic::<A>(&place);
    let feedback = qos::build(true, Durability::Volatile, FEEDBACK_DEPTH);
    let latched = qos::build(true, Durability::TransientLocal, 1);
    let desk = Arc::new(Desk {
        name: place.name.to_owned(),
        goals: Mutex::new(Goals::new()),
        results: Server::new(dds, mapping, &place.part("get_result"))?,
        feedback: Arc::new(dds.writer(&topic, &kind, &feedback)?),
        status: Publisher::new(dds, &place.part("status"), &latched)?,
        clock: place.clock.clone(),
        stop: place.stop.clone(),
    });
    let send_goal = Server::<A::SendGoal>::new(dds, mapping, &place.part("send_goal"))?;
    let cancel_goal = Server::<CancelGoal>::new(dds, mapping, &place.part("cancel_goal"))?;
    tokio::spawn(Arc::clone(&desk).take_goals(send_goal, accept, execute));
    let cancelling = Arc::clone(&desk);
    let cancel = move |request| std::future::ready(cancelling.cancel(&request));
    tokio::spawn(answer_all(cancel_goal, cancel, place.stop.clone()));
    tokio::spawn(desk.give_results());
    Ok(())
}

struct Desk<A: Action> {
    name: String,
    goals: Mutex<Goals<A::Result, Call>>,
    results: Server<A::GetResult>,
    feedback: Arc<Writer>,
    status: Publisher<GoalStatusArray>,
    clock: Clock,
    stop: Stop,
}

impl<A: Action> Desk<A> {
    fn goals(&self) -> MutexGuard<'_, Goals<A::Result, Call>> {
        self.goals.lock().unwrap_or_else(PoisonError::into_inner)
    }

    async fn take_goals<C, H, F>(
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
                Ok(()) => Some(self.enter(id, goal, stamp)),
                Err(reason) => {
                    tracing::warn!("{}: goal refused: {reason}", self.name);
                    None
                }
            };
            server.answer(&call, &SendGoalResponse { accepted, stamp: stamp.into() }).await;
            if let Some(goal) = goal {
                self.match_feedback(&call).await;
                let cancel = goal.flag();
                let work = execute(goal);
                tokio::spawn(Arc::clone(&self).run(id, cancel, work));
            }
        }
    }

    /// Waits until the client hears feedback; without it the first would be lost.
    async fn match_feedback(&self, call: &Call) {
        let writer = self.feedback.guid();
        let matched = self.feedback.matches().wait(|matches| {
            matches.of(writer).iter().any(|reader| call.is_from_participant_of(reader))
        });
        // A client that does not care for feedback is served all the same.
        let _ = tokio::time::timeout(FEEDBACK_WAIT, matched).await;
    }

    fn enter(&self, id: GoalId, goal: A::Goal, stamp: Stamp) -> Goal<A> {
        let cancel = self.stop.child();
        self.change(|goals| goals.accept(id, stamp, cancel.clone()));
        Goal::new(id, goal, cancel, Arc::clone(&self.feedback))
    }

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
        // Ends the task behind the flag.
        cancel.stop();
        let response = GetResultResponse { status, result };
        for call in self.change(|goals| goals.end(id, &response)) {
            self.results.answer(&call, &response).await;
        }
    }

    /// Changes the goals and publishes the status of all.
    fn change<T>(&self, change: impl FnOnce(&mut Goals<A::Result, Call>) -> T) -> T {
        let mut goals = self.goals();
        let changed = change(&mut goals);
        // Locked while publishing: an older list must not come later.
        if let Err(error) = self.status.publish(&goals.status()) {
            tracing::warn!("{error:#}");
        }
        changed
    }

    fn cancel(&self, request: &CancelGoalRequest) -> CancelGoalResponse {
        self.change(|goals| goals.cancel(request))
    }

    async fn give_results(self: Arc<Self>) {
        while let Some((call, request)) = self.stop.or(self.results.receive()).await {
            let answer = self.goals().ask(request.goal_id.uuid, call);
            if let Answer::Now(call, response) = answer {
                self.results.answer(&call, &response).await;
            }
        }
    }
}
