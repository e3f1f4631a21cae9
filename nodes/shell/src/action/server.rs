//! The serving end of an action.

use super::goal::{Goal, Outcome};
use super::{GoalId, Place, feedback_topic};
use crate::clock::Clock;
use crate::dds::Writer;
use crate::service::{Server, answer_all};
use crate::{Publisher, Stamp, Stop, qos};
use anyhow::Result;
use puffer_msgs::action_msgs::msg::{GoalInfo, GoalStatus, GoalStatusArray};
use puffer_msgs::action_msgs::srv::{CancelGoal, CancelGoalRequest, CancelGoalResponse};
use puffer_msgs::unique_identifier_msgs::msg::UUID;
use puffer_msgs::{Action, GetResultResponse, SendGoalRequest, SendGoalResponse};
use rustdds::policy::Durability;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::watch;

/// Goals that have ended and whose results are kept.
const ENDED_KEPT: usize = 32;
const FEEDBACK_DEPTH: i32 = 10;

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
        goals: Mutex::default(),
        feedback: Arc::new(dds.writer(&topic, &kind, &feedback)?),
        status: Publisher::new(dds, &place.part("status"), &latched)?,
        clock: place.clock.clone(),
        stop: place.stop.clone(),
    });
    let send_goal = Server::<A::SendGoal>::new(dds, mapping, &place.part("send_goal"))?;
    let cancel_goal = Server::<CancelGoal>::new(dds, mapping, &place.part("cancel_goal"))?;
    let get_result = Server::<A::GetResult>::new(dds, mapping, &place.part("get_result"))?;
    tokio::spawn(Arc::clone(&desk).take_goals(send_goal, accept, execute));
    let cancelling = Arc::clone(&desk);
    let cancel = move |request| std::future::ready(cancelling.cancel(&request));
    tokio::spawn(answer_all(cancel_goal, cancel, place.stop.clone()));
    tokio::spawn(desk.give_results(Arc::new(get_result)));
    Ok(())
}

struct Desk<A: Action> {
    name: String,
    goals: Mutex<Vec<Record<A>>>,
    feedback: Arc<Writer>,
    status: Publisher<GoalStatusArray>,
    clock: Clock,
    stop: Stop,
}

struct Record<A: Action> {
    id: GoalId,
    stamp: Stamp,
    status: i8,
    cancel: Stop,
    end: watch::Sender<Option<GetResultResponse<A::Result>>>,
}

impl<A: Action> Record<A> {
    fn info(&self) -> GoalInfo {
        GoalInfo { goal_id: UUID { uuid: self.id }, stamp: self.stamp.into() }
    }

    fn has_ended(&self) -> bool {
        self.end.borrow().is_some()
    }
}

impl<A: Action> Desk<A> {
    fn goals(&self) -> MutexGuard<'_, Vec<Record<A>>> {
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
            let verdict = if self.goals().iter().any(|record| record.id == id) {
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
                let work = execute(goal);
                tokio::spawn(Arc::clone(&self).run(id, work));
            }
        }
    }

    fn enter(&self, id: GoalId, goal: A::Goal, stamp: Stamp) -> Goal<A> {
        let cancel = self.stop.child();
        let status = GoalStatus::STATUS_ACCEPTED;
        let end = watch::Sender::new(None);
        {
            let mut goals = self.goals();
            goals.push(Record { id, stamp, status, cancel: cancel.clone(), end });
            let ended = goals.iter().filter(|record| record.has_ended()).count();
            if ended > ENDED_KEPT
                && let Some(oldest) = goals.iter().position(Record::has_ended)
            {
                goals.remove(oldest);
            }
        }
        self.tell();
        Goal::new(id, goal, cancel, Arc::clone(&self.feedback))
    }

    async fn run(
        self: Arc<Self>,
        id: GoalId,
        work: impl Future<Output = Outcome<A::Result>> + Send + 'static,
    ) {
        self.change(id, |record| {
            if record.status == GoalStatus::STATUS_ACCEPTED {
                record.status = GoalStatus::STATUS_EXECUTING;
            }
        });
        let outcome = tokio::spawn(work).await.unwrap_or_else(|error| {
            tracing::error!("{}: goal aborted: {error}", self.name);
            Outcome::Aborted(A::Result::default())
        });
        let (status, result) = match outcome {
            Outcome::Succeeded(result) => (GoalStatus::STATUS_SUCCEEDED, result),
            Outcome::Aborted(result) => (GoalStatus::STATUS_ABORTED, result),
            Outcome::Canceled(result) => (GoalStatus::STATUS_CANCELED, result),
        };
        self.change(id, |record| {
            record.status = status;
            record.end.send_replace(Some(GetResultResponse { status, result }));
            // Ends the task behind the flag.
            record.cancel.stop();
        });
    }

    fn change(&self, id: GoalId, change: impl FnOnce(&mut Record<A>)) {
        if let Some(record) = self.goals().iter_mut().find(|record| record.id == id) {
            change(record);
        }
        self.tell();
    }

    /// Publishes the status of all goals.
    fn tell(&self) {
        let goals = self.goals();
        let status = |r: &Record<A>| GoalStatus { goal_info: r.info(), status: r.status };
        let status_list = goals.iter().map(status).collect();
        // Locked while publishing: an older list must not come later.
        if let Err(error) = self.status.publish(&GoalStatusArray { status_list }) {
            tracing::warn!("{error:#}");
        }
    }

    /// As rcl_action: number and stamp zero mean all goals; a stamp alone, all up to it; a number, that goal, with a
    /// stamp also those up to it.
    fn cancel(&self, request: &CancelGoalRequest) -> CancelGoalResponse {
        let GoalInfo { goal_id: UUID { uuid: id }, stamp } = request.goal_info;
        let (by_id, until) = (id != [0; 16], Stamp::from(stamp));
        let mut response = CancelGoalResponse::default();
        {
            let mut goals = self.goals();
            if by_id && until == Stamp::ZERO {
                response.return_code = match goals.iter().find(|record| record.id == id) {
                    None => CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID,
                    Some(record) if record.has_ended() => CancelGoalResponse::ERROR_GOAL_TERMINATED,
                    Some(_) => CancelGoalResponse::ERROR_NONE,
                };
            }
            for record in goals.iter_mut().filter(|record| !record.has_ended()) {
                let all = !by_id && until == Stamp::ZERO;
                if all
                    || (by_id && record.id == id)
                    || (until > Stamp::ZERO && record.stamp <= until)
                {
                    record.status = GoalStatus::STATUS_CANCELING;
                    record.cancel.stop();
                    response.goals_canceling.push(record.info());
                }
            }
        }
        self.tell();
        response
    }

    async fn give_results(self: Arc<Self>, server: Arc<Server<A::GetResult>>) {
        while let Some((call, request)) = self.stop.or(server.receive()).await {
            let goals = self.goals();
            let record = goals.iter().find(|record| record.id == request.goal_id.uuid);
            let end = record.map(|record| record.end.subscribe());
            drop(goals);
            let (server, stop) = (Arc::clone(&server), self.stop.clone());
            tokio::spawn(async move {
                let answer = match end {
                    None => Some(GetResultResponse::default()),
                    Some(mut end) => match stop.or(end.wait_for(Option::is_some)).await {
                        Some(Ok(ended)) => ended.clone(),
                        // The node stops.
                        _ => None,
                    },
                };
                if let Some(answer) = answer {
                    server.answer(&call, &answer).await;
                }
            });
        }
    }
}
