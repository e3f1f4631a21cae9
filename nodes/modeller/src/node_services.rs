//! What a run asks of the other nodes, whoever answers.

use crate::params::ModellerParams;
use anyhow::Result;
use puffer_msgs::action::{ReconstructMeshGoal, ReconstructMeshResult, RefineResult};
use puffer_msgs::srv::{FilterResponse, PlanViewRequest, PlanViewResponse};
use puffer_msgs::trajectory_msgs::msg::JointTrajectory;
use puffer_ros::{Stamp, Stop};
use std::time::Duration;

/// The services and actions that the steps of a run call.
///
/// All calls fail with the reason of the node that answers, or with an error that names the node if
/// there is no answer within `deadline` (wall time). Setting `stop` cancels an action.
pub(crate) trait NodeServices: Sync {
    /// Files and deadlines as they are configured now.
    fn params(&self) -> ModellerParams;

    /// Now, on the robot's clock.
    fn now(&self) -> Stamp;

    /// Plans the next view.
    fn plan_view(
        &self,
        request: &PlanViewRequest,
        deadline: Duration,
    ) -> impl Future<Output = Result<PlanViewResponse>> + Send;

    /// Moves the robot along `trajectory`.
    fn follow_trajectory(
        &self,
        trajectory: &JointTrajectory,
        deadline: Duration,
        stop: &Stop,
    ) -> impl Future<Output = Result<()>> + Send;

    /// Takes a scan.
    fn trigger_scan(&self, deadline: Duration) -> impl Future<Output = Result<()>> + Send;

    /// Optimises the poses of all scans together, once `scans` scans have arrived.
    fn refine(
        &self,
        scans: usize,
        deadline: Duration,
        stop: &Stop,
    ) -> impl Future<Output = Result<RefineResult>> + Send;

    /// Combines all scans to one cloud, once `scans` scans and the poses of `revision` have
    /// arrived.
    fn filter(
        &self,
        scans: usize,
        revision: u32,
        deadline: Duration,
    ) -> impl Future<Output = Result<FilterResponse>> + Send;

    /// Makes the mesh. A mesh that is not trustworthy, and therefore not written, is no error.
    fn reconstruct(
        &self,
        goal: ReconstructMeshGoal,
        deadline: Duration,
        stop: &Stop,
    ) -> impl Future<Output = Result<ReconstructMeshResult>> + Send;
}
