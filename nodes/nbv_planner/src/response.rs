//! Plans as messages.

use puffer_core::planner::PlanningResult;
use puffer_core::robot::Trajectory;
use puffer_core::view::{Candidate, Termination, TerminationCause};
use puffer_msgs::builtin_interfaces::msg::Duration;
use puffer_msgs::msg;
use puffer_msgs::srv::PlanViewResponse;
use puffer_msgs::trajectory_msgs::msg::{JointTrajectory, JointTrajectoryPoint};
use puffer_ros::conversions::pose_message;

/// Candidates listed in a response at most: it must fit a datagram.
const MAX_CANDIDATES: usize = 60;

/// The response to a request that was planned; `joints` are the names of the robot's joints.
pub(crate) fn from_result(result: &PlanningResult, joints: &[String]) -> PlanViewResponse {
    let plan = &result.plan;
    let counts = &plan.counts;
    let mut response = PlanViewResponse {
        success: true,
        coverage: plan.coverage as f32,
        voxel_edge: result.voxel_edge as f32,
        occupied: counts.occupied as u32,
        satisfied: counts.satisfied as u32,
        possible_border: counts.possible_border as u32,
        possible_inside: counts.possible_inside as u32,
        candidate_count: plan.candidates.len() as u32,
        candidates: plan.candidates.iter().take(MAX_CANDIDATES).map(candidate_message).collect(),
        ..PlanViewResponse::default()
    };
    match (&plan.chosen, &result.motion) {
        (Some(chosen), Some(motion)) => {
            response.view = pose_message(&chosen.pose);
            response.expected_gain = chosen.gain as f32;
            response.trajectory = trajectory_message(&motion.path, joints);
            response.message =
                format!("{} of {} candidates", chosen.candidate + 1, plan.candidates.len());
        }
        _ => {
            response.done = true;
            if let Some(termination) = &plan.done {
                report_termination(termination, &mut response);
            }
        }
    }
    response
}

fn report_termination(termination: &Termination, response: &mut PlanViewResponse) {
    response.message = termination.text.clone();
    response.done_cause = match termination.cause {
        TerminationCause::NoFirstView => PlanViewResponse::NO_FIRST_VIEW,
        TerminationCause::NothingAsks => PlanViewResponse::NOTHING_ASKS,
        TerminationCause::NotWorthIt => PlanViewResponse::NOT_WORTH_IT,
        TerminationCause::Refused => PlanViewResponse::REFUSED,
    };
    response.not_worth_it = termination.not_worth_it as u32;
    response.refusals = termination.refusals.iter().map(|(kind, _)| (*kind).to_owned()).collect();
    response.refusal_counts = termination.refusals.iter().map(|(_, count)| *count as u32).collect();
}

fn candidate_message(candidate: &Candidate) -> msg::Candidate {
    msg::Candidate {
        view: pose_message(&candidate.pose),
        gain: candidate.gain as f32,
        asked: candidate.asked,
        reachable: candidate.reachable,
        reason: candidate.reason.clone(),
    }
}

/// A trajectory of the joints `names`.
fn trajectory_message(trajectory: &Trajectory, names: &[String]) -> JointTrajectory {
    let points = trajectory.positions.iter().zip(&trajectory.times);
    JointTrajectory {
        joint_names: names.to_vec(),
        points: points.map(|(positions, seconds)| trajectory_point(positions, *seconds)).collect(),
        ..JointTrajectory::default()
    }
}

fn trajectory_point(positions: &[f64], seconds: f64) -> JointTrajectoryPoint {
    JointTrajectoryPoint {
        positions: positions.to_vec(),
        time_from_start: Duration::from_seconds(seconds),
        ..JointTrajectoryPoint::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::geometry::Pose;
    use puffer_core::robot::ViewMotion;
    use puffer_core::view::{ChosenView, Plan, VoxelCounts};

    fn candidate(x: f64, refusal: Option<&'static str>) -> Candidate {
        Candidate {
            pose: Pose::translation(x, 0.0, 0.0),
            gain: x,
            lacking: 0,
            hidden: 0,
            unknown: 0,
            overlap: 1.0,
            asked: true,
            reachable: refusal.is_none(),
            reason: refusal.unwrap_or_default().to_owned(),
            refusal,
        }
    }

    fn plan(candidates: Vec<Candidate>) -> Plan {
        let counts = VoxelCounts { occupied: 8, satisfied: 6, ..VoxelCounts::default() };
        Plan { chosen: None, candidates, coverage: 0.75, counts, done: None }
    }

    #[test]
    fn a_chosen_view_comes_with_its_motion_and_the_best_candidates() {
        let mut plan = plan((0..100).map(|i| candidate(f64::from(i), None)).collect());
        let pose = Pose::translation(0.0, 0.0, 0.5);
        let (gain, expected_new, duration) = (7.0, 7, 2.0);
        plan.chosen = Some(ChosenView { pose, candidate: 1, gain, expected_new, duration });
        let path = Trajectory { positions: vec![vec![0.0], vec![0.5]], times: vec![0.0, 2.0] };
        let q = vec![0.5];
        let motion = ViewMotion { q, object_from_sensor: pose, path, sweep: None, duration };
        let result = PlanningResult { plan, motion: Some(motion), voxel_edge: 0.004 };
        let response = from_result(&result, &["joint_1".to_owned()]);
        assert!(response.success && !response.done);
        assert_eq!(response.message, "2 of 100 candidates");
        assert_eq!((response.candidate_count, response.candidates.len()), (100, MAX_CANDIDATES));
        assert_eq!((response.occupied, response.satisfied, response.coverage), (8, 6, 0.75));
        assert_eq!((response.view.position.z, response.expected_gain), (0.5, 7.0));
        assert_eq!(response.trajectory.joint_names, ["joint_1"]);
        assert_eq!(response.trajectory.points[1].positions, [0.5]);
        assert_eq!(response.trajectory.points[1].time_from_start, Duration::from_seconds(2.0));
    }

    #[test]
    fn the_end_of_planning_comes_with_its_cause_and_the_refusals() {
        let mut plan = plan(vec![candidate(0.0, Some("out of reach"))]);
        plan.done = Some(Termination {
            cause: TerminationCause::Refused,
            text: "no view is left".to_owned(),
            refusals: vec![("out of reach", 1)],
            not_worth_it: 3,
        });
        let result = PlanningResult { plan, motion: None, voxel_edge: 0.004 };
        let response = from_result(&result, &[]);
        assert!(response.success && response.done);
        assert_eq!(response.done_cause, PlanViewResponse::REFUSED);
        assert_eq!((response.message.as_str(), response.not_worth_it), ("no view is left", 3));
        assert_eq!(
            (response.refusals[0].as_str(), response.refusal_counts[0]),
            ("out of reach", 1)
        );
        assert!(response.trajectory.points.is_empty());
        assert!(!response.candidates[0].reachable);
        assert_eq!(response.candidates[0].reason, "out of reach");
    }
}
