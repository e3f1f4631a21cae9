//! The goals that an action server knows.

use super::action_context::GoalId;
use crate::{Stamp, Stop};
use puffer_msgs::GetResultResponse;
use puffer_msgs::action_msgs::msg::{GoalInfo, GoalStatus, GoalStatusArray};
use puffer_msgs::action_msgs::srv::{CancelGoalRequest, CancelGoalResponse};
use std::time::{Duration, Instant};

/// How long a result can be asked for after the goal's end: 15 minutes, the former default of
/// rcl_action.
const RESULT_LIFETIME: Duration = Duration::from_secs(15 * 60);
/// Largest number of ended goals whose results are kept.
const MAX_ENDED_GOALS: usize = 64;

/// One goal with results of type `R`; `W` is a request that waits for the result.
struct GoalEntry<R, W> {
    info: GoalInfo,
    status: i8,
    cancel: Stop,
    waiting: Vec<W>,
    ended: Option<(Instant, GetResultResponse<R>)>,
}

/// The goals in the order of acceptance.
pub(super) struct GoalTable<R, W> {
    entries: Vec<GoalEntry<R, W>>,
}

/// How a request for a result is answered.
pub(super) enum ResultReply<R, W> {
    /// At once, with this response.
    Now(W, GetResultResponse<R>),
    /// When the goal ends; the table keeps the request until then.
    Later,
}

impl<R: Clone + Default, W> GoalTable<R, W> {
    pub fn new() -> Self {
        Self { entries: Vec::new() }
    }

    fn find(&mut self, id: GoalId) -> Option<&mut GoalEntry<R, W>> {
        self.entries.iter_mut().find(|entry| entry.info.goal_id.uuid == id)
    }

    /// Whether the goal is known.
    pub fn contains(&self, id: GoalId) -> bool {
        self.entries.iter().any(|entry| entry.info.goal_id.uuid == id)
    }

    /// Adds an accepted goal; `cancel` asks its work to end.
    pub fn accept(&mut self, id: GoalId, stamp: Stamp, cancel: Stop) {
        self.evict_old_results();
        let mut info = GoalInfo { stamp: stamp.into(), ..Default::default() };
        info.goal_id.uuid = id;
        let status = GoalStatus::STATUS_ACCEPTED;
        self.entries.push(GoalEntry { info, status, cancel, waiting: Vec::new(), ended: None });
    }

    fn evict_old_results(&mut self) {
        self.entries.retain(|entry| {
            entry.ended.as_ref().is_none_or(|(at, _)| at.elapsed() < RESULT_LIFETIME)
        });
        let ended = self.entries.iter().filter(|entry| entry.ended.is_some()).count();
        let mut surplus = ended.saturating_sub(MAX_ENDED_GOALS);
        self.entries.retain(|entry| {
            let keep = entry.ended.is_none() || surplus == 0;
            surplus -= usize::from(!keep);
            keep
        });
    }

    /// Marks a goal as executing, unless it is to be cancelled already.
    pub fn start(&mut self, id: GoalId) {
        if let Some(entry) = self.find(id).filter(|e| e.status == GoalStatus::STATUS_ACCEPTED) {
            entry.status = GoalStatus::STATUS_EXECUTING;
        }
    }

    /// Notes how a goal ended; returns the requests that wait for its result.
    pub fn end(&mut self, id: GoalId, response: &GetResultResponse<R>) -> Vec<W> {
        let Some(entry) = self.find(id) else { return Vec::new() };
        entry.status = response.status;
        entry.ended = Some((Instant::now(), response.clone()));
        std::mem::take(&mut entry.waiting)
    }

    /// Takes a request for the result of a goal.
    pub fn request_result(&mut self, id: GoalId, asker: W) -> ResultReply<R, W> {
        match self.find(id) {
            None => ResultReply::Now(asker, GetResultResponse::default()),
            Some(entry) => match &entry.ended {
                Some((_, response)) => ResultReply::Now(asker, response.clone()),
                None => {
                    entry.waiting.push(asker);
                    ResultReply::Later
                }
            },
        }
    }

    /// Cancels the goals that a request of action_msgs/srv/CancelGoal means: the goal of its id;
    /// with a stamp also all that were accepted until then; without id and stamp all.
    pub fn cancel(&mut self, request: &CancelGoalRequest) -> CancelGoalResponse {
        let wanted = &request.goal_info;
        let id = wanted.goal_id.uuid;
        let (any_id, any_stamp) = (id == [0; 16], wanted.stamp == Default::default());
        let mut response = CancelGoalResponse::default();
        for entry in self.entries.iter_mut().filter(|entry| entry.ended.is_none()) {
            let until = Stamp::from(entry.info.stamp) <= Stamp::from(wanted.stamp);
            if entry.info.goal_id.uuid == id || (!any_stamp && until) || (any_id && any_stamp) {
                entry.status = GoalStatus::STATUS_CANCELING;
                entry.cancel.stop();
                response.goals_canceling.push(entry.info);
            }
        }
        response.return_code = if !response.goals_canceling.is_empty() {
            CancelGoalResponse::ERROR_NONE
        } else if any_id {
            CancelGoalResponse::ERROR_REJECTED
        } else if self.contains(id) {
            CancelGoalResponse::ERROR_GOAL_TERMINATED
        } else {
            CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID
        };
        response
    }

    /// The status of all goals.
    pub fn status(&self) -> GoalStatusArray {
        let status_list = self
            .entries
            .iter()
            .map(|entry| GoalStatus { goal_info: entry.info, status: entry.status })
            .collect();
        GoalStatusArray { status_list }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(id: u8, stamp: i64) -> CancelGoalRequest {
        let mut request = CancelGoalRequest::default();
        request.goal_info.goal_id.uuid = [id; 16];
        request.goal_info.stamp = Stamp::from_nanos(stamp).into();
        request
    }

    fn goals() -> GoalTable<u32, &'static str> {
        let mut goals = GoalTable::new();
        for id in 1..=3 {
            goals.accept([id; 16], Stamp::from_nanos(i64::from(id) * 10), Stop::new());
        }
        goals
    }

    #[test]
    fn a_result_waits_for_askers_and_askers_for_the_result() {
        let mut goals = goals();
        assert!(matches!(goals.request_result([1; 16], "early"), ResultReply::Later));
        let end = GetResultResponse { status: GoalStatus::STATUS_SUCCEEDED, result: 7 };
        assert_eq!(goals.end([1; 16], &end), ["early"]);
        for _ in 0..2 {
            assert!(
                matches!(goals.request_result([1; 16], "late"), ResultReply::Now("late", found) if found == end)
            );
        }
        let unknown = goals.request_result([9; 16], "lost");
        assert!(
            matches!(unknown, ResultReply::Now(_, r) if r.status == GoalStatus::STATUS_UNKNOWN)
        );
    }

    #[test]
    fn cancelling_follows_the_four_rules() {
        for (id, stamp, code, count) in [
            (2, 0, CancelGoalResponse::ERROR_NONE, 1),
            (0, 0, CancelGoalResponse::ERROR_NONE, 3),
            (0, 20, CancelGoalResponse::ERROR_NONE, 2),
            (3, 10, CancelGoalResponse::ERROR_NONE, 2),
            (9, 0, CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID, 0),
        ] {
            let response = goals().cancel(&request(id, stamp));
            assert_eq!((response.return_code, response.goals_canceling.len()), (code, count));
        }
        let mut goals = goals();
        let end = GetResultResponse { status: GoalStatus::STATUS_ABORTED, result: 0 };
        goals.end([2; 16], &end);
        let response = goals.cancel(&request(2, 0));
        assert_eq!(response.return_code, CancelGoalResponse::ERROR_GOAL_TERMINATED);
        assert_eq!(goals.status().status_list[1].status, GoalStatus::STATUS_ABORTED);
    }

    #[test]
    fn old_results_go_and_running_goals_stay() {
        let mut goals = goals();
        let end = GetResultResponse { status: GoalStatus::STATUS_SUCCEEDED, result: 0 };
        for id in 10..110 {
            goals.accept([id; 16], Stamp::ZERO, Stop::new());
            goals.end([id; 16], &end);
        }
        goals.accept([200; 16], Stamp::ZERO, Stop::new());
        assert_eq!(goals.entries.len(), 3 + MAX_ENDED_GOALS + 1);
        assert!(goals.contains([1; 16]) && !goals.contains([10; 16]) && goals.contains([109; 16]));
    }
}
