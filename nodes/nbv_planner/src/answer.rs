//! Plans as messages.

use crate::desk::Answer;
use puffer_core::robot::Trajectory;
use puffer_core::view::{Candidate, Cause, Ending};
use puffer_msgs::builtin_interfaces::msg::Duration;
use puffer_msgs::msg;
use puffer_msgs::srv::PlanViewResponse;
use puffer_msgs::trajectory_msgs::msg::{JointTrajectory, JointTrajectoryPoint};
use puffer_shell::convert::pose_message;

/// Candidates told at most: an answer must fit a datagram.
const CANDIDATES_TOLD: usize = 60;

/// The answer to a request.
pub(crate) fn response(answer: &Answer, joints: &[String]) -> PlanViewResponse {
    let plan = &answer.plan;
    let counts = &plan.counts;
    let mut response = PlanViewResponse {
        success: true,
        coverage: plan.coverage as f32,
        voxel_edge: answer.voxel_edge as f32,
        occupied: counts.occupied as u32,
        satisfied: counts.satisfied as u32,
        possible_border: counts.possible_border as u32,
        possible_inside: counts.possible_inside as u32,
        candidate_count: plan.candidates.len() as u32,
        candidates: plan.candidates.iter().take(CANDIDATES_TOLD).map(candidate).collect(),
        ..PlanViewResponse::default()
    };
    match (&plan.chosen, &answer.reached) {
        (Some(chosen), Some(reached)) => {
            response.view = pose_message(&chosen.pose);
            response.expected_gain = chosen.gain as f32;
            response.trajectory = trajectory(&reached.path, joints);
            response.message =
                format!("{} of {} candidates", chosen.candidate + 1, plan.candidates.len());
        }
        _ => {
            response.done = true;
            if let Some(ending) = &plan.done {
                tell_ending(ending, &mut response);
            }
        }
    }
    response
}

fn tell_ending(ending: &Ending, response: &mut PlanViewResponse) {
    response.message = ending.text.clone();
    response.done_cause = match ending.cause {
        Cause::NoFirstView => PlanViewResponse::NO_FIRST_VIEW,
        Cause::NothingAsks => PlanViewResponse::NOTHING_ASKS,
        Cause::NotWorthIt => PlanViewResponse::NOT_WORTH_IT,
        Cause::Refused => PlanViewResponse::REFUSED,
    };
    response.not_worth_it = ending.not_worth_it as u32;
    response.refusals = ending.refusals.iter().map(|(kind, _)| (*kind).to_owned()).collect();
    response.refusal_counts = ending.refusals.iter().map(|(_, count)| *count as u32).collect();
}

fn candidate(candidate: &Candidate) -> msg::Candidate {
    msg::Candidate {
        view: pose_message(&candidate.pose),
        gain: candidate.gain as f32,
        asked: candidate.asked,
        reachable: candidate.reachable,
        reason: candidate.reason.clone(),
    }
}

/// A trajectory of the joints `names`.
fn trajectory(way: &Trajectory, names: &[String]) -> JointTrajectory {
    let point = |(positions, seconds): (&Vec<f64>, &f64)| JointTrajectoryPoint {
        positions: positions.clone(),
        time_from_start: Duration::from_seconds(*seconds),
        ..JointTrajectoryPoint::default()
    };
    JointTrajectory {
        joint_names: names.to_vec(),
        points: way.positions.iter().zip(&way.times).map(point).collect(),
        ..JointTrajectory::default()
    }
}
