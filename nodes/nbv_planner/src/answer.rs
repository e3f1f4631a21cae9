//! Plans as messages.

use crate::desk::Answer;
use puffer_core::robot::Trajectory;
use puffer_core::view::Candidate;
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
            response.message = plan.done.clone().unwrap_or_else(|| "no view is left".to_owned());
        }
    }
    response
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
