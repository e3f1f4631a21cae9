//! The other nodes, as the modeller sees them.

use crate::Params;
use anyhow::{Context, Result, anyhow, bail};
use puffer_msgs::action::{
    ReconstructMesh, ReconstructMeshGoal, ReconstructMeshResult, Refine, RefineGoal, RefineResult,
};
use puffer_msgs::control_msgs::action::{FollowJointTrajectory, FollowJointTrajectoryGoal};
use puffer_msgs::srv::{
    Filter, FilterRequest, FilterResponse, PlanView, PlanViewRequest, PlanViewResponse,
    ReconstructResponse,
};
use puffer_msgs::std_srvs::srv::{Trigger, TriggerRequest};
use puffer_msgs::trajectory_msgs::msg::JointTrajectory;
use puffer_shell::{Action, ActionClient, Client, GoalHandle, Node, Outcome, Stop};
use std::time::{Duration, Instant};

/// How long a partner may take to accept a goal.
const ACCEPT_DEADLINE: Duration = Duration::from_secs(30);
/// How long a cancelled goal may take to end.
const CANCEL_DEADLINE: Duration = Duration::from_secs(10);

/// Clients of all services and actions that modelling uses.
pub(crate) struct Partners {
    node: Node<Params>,
    plan: Client<PlanView>,
    drive: ActionClient<FollowJointTrajectory>,
    trigger: Client<Trigger>,
    refine: ActionClient<Refine>,
    filter: Client<Filter>,
    reconstruct: ActionClient<ReconstructMesh>,
    resets: Vec<Client<Trigger>>,
}

impl Partners {
    pub(crate) fn new(node: &Node<Params>) -> Result<Partners> {
        let resets = ["scan_registrar", "nbv_planner", "cloud_filter"];
        Ok(Partners {
            node: node.clone(),
            plan: node.client("nbv_planner/plan_view")?,
            drive: node.action_client("follow_joint_trajectory")?,
            trigger: node.client("trigger_scan")?,
            refine: node.action_client("scan_registrar/refine")?,
            filter: node.client("cloud_filter/filter")?,
            reconstruct: node.action_client("mesh_reconstructor/reconstruct_action")?,
            resets: resets
                .iter()
                .map(|name| node.client(&format!("{name}/reset")))
                .collect::<Result<_>>()?,
        })
    }

    /// Waits until all are there.
    ///
    /// # Errors
    /// Names those that are missing after the deadline.
    pub(crate) async fn ready(&self) -> Result<()> {
        self.wait_for(|| {
            let mut all = vec![
                ("nbv_planner", self.plan.is_ready()),
                ("the robot's controller (follow_joint_trajectory)", self.drive.is_ready()),
                ("the sensor (trigger_scan)", self.trigger.is_ready()),
            ];
            all.extend(self.makers());
            all
        })
        .await
    }

    /// Whether robot and sensor are there.
    pub(crate) fn has_driver(&self) -> bool {
        self.drive.is_ready() && self.trigger.is_ready()
    }

    /// Waits until those are there that make a mesh of scans that were taken.
    ///
    /// # Errors
    /// Names those that are missing after the deadline.
    pub(crate) async fn ready_to_finish(&self) -> Result<()> {
        self.wait_for(|| self.makers().to_vec()).await
    }

    fn makers(&self) -> [(&'static str, bool); 3] {
        [
            ("scan_registrar", self.refine.is_ready()),
            ("cloud_filter", self.filter.is_ready()),
            ("mesh_reconstructor", self.reconstruct.is_ready()),
        ]
    }

    async fn wait_for(&self, look: impl Fn() -> Vec<(&'static str, bool)>) -> Result<()> {
        let deadline = self.deadline(|p| p.start_deadline);
        let since = Instant::now();
        loop {
            let there = look();
            let missing: Vec<&str> =
                there.iter().filter(|(_, ready)| !ready).map(|(name, _)| *name).collect();
            if missing.is_empty() {
                return Ok(());
            }
            if since.elapsed() > deadline {
                bail!(
                    "not there after {:.0} s on domain {}: {}",
                    deadline.as_secs_f64(),
                    self.node.domain(),
                    missing.join(", ")
                );
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    fn deadline(&self, of: impl Fn(&crate::ModellerParams) -> f64) -> Duration {
        Duration::from_secs_f64(of(&self.node.params().modeller))
    }

    /// Lets all forget earlier scans.
    pub(crate) async fn reset(&self) -> Result<()> {
        for client in &self.resets {
            client.call(&TriggerRequest::default(), self.deadline(|p| p.start_deadline)).await?;
        }
        Ok(())
    }

    pub(crate) async fn plan(&self, request: &PlanViewRequest) -> Result<PlanViewResponse> {
        let response = self.plan.call(request, self.deadline(|p| p.plan_deadline)).await?;
        if !response.success {
            bail!("{}", response.message);
        }
        Ok(response)
    }

    /// Moves the robot along `trajectory`; stops it if `stop` is set.
    pub(crate) async fn drive(&self, trajectory: &JointTrajectory, stop: &Stop) -> Result<()> {
        let goal = FollowJointTrajectoryGoal {
            trajectory: trajectory.clone(),
            ..FollowJointTrajectoryGoal::default()
        };
        let time = trajectory.points.last().map_or(0.0, |p| {
            f64::from(p.time_from_start.sec) + f64::from(p.time_from_start.nanosec) * 1e-9
        });
        let deadline = self.deadline(|p| p.move_deadline) + Duration::from_secs_f64(time.max(0.0));
        let handle = send(&self.drive, &goal).await?;
        let result = ended(&handle, deadline, stop).await?;
        match result {
            Outcome::Succeeded(_) => Ok(()),
            Outcome::Aborted(result) | Outcome::Canceled(result) => {
                bail!("{} (code {})", result.error_string, result.error_code)
            }
        }
    }

    pub(crate) async fn trigger(&self) -> Result<()> {
        let deadline = self.deadline(|p| p.scan_deadline);
        let response = self.trigger.call(&TriggerRequest::default(), deadline).await?;
        if !response.success {
            bail!("{}", response.message);
        }
        Ok(())
    }

    pub(crate) async fn refine(&self, scans: usize, stop: &Stop) -> Result<RefineResult> {
        let handle = send(&self.refine, &RefineGoal { scans: scans as u32 }).await?;
        match ended(&handle, self.deadline(|p| p.refine_deadline), stop).await? {
            Outcome::Succeeded(result) => Ok(result),
            Outcome::Aborted(result) | Outcome::Canceled(result) => Err(anyhow!(result.error_msg)),
        }
    }

    pub(crate) async fn filter(&self, scans: usize, revision: u32) -> Result<FilterResponse> {
        let request = FilterRequest { scans: scans as u32, revision };
        let response = self.filter.call(&request, self.deadline(|p| p.filter_deadline)).await?;
        if !response.success {
            bail!("{}", response.message);
        }
        Ok(response)
    }

    /// Has the mesh made; that it is not trustworthy, and not written, is no error.
    pub(crate) async fn reconstruct(
        &self,
        mut goal: ReconstructMeshGoal,
        stop: &Stop,
    ) -> Result<ReconstructMeshResult> {
        goal.output_path = self.node.params().modeller.mesh_path;
        let handle = send(&self.reconstruct, &goal).await?;
        match ended(&handle, self.deadline(|p| p.reconstruct_deadline), stop).await? {
            Outcome::Succeeded(result) => Ok(result),
            Outcome::Aborted(result)
                if result.error_code == ReconstructResponse::NOT_TRUSTWORTHY =>
            {
                Ok(result)
            }
            Outcome::Aborted(result) | Outcome::Canceled(result) => Err(anyhow!(result.error_msg)),
        }
    }
}

async fn send<A: Action>(client: &ActionClient<A>, goal: &A::Goal) -> Result<GoalHandle<A>> {
    let handle = client.send(goal, ACCEPT_DEADLINE).await?;
    handle.with_context(|| format!("{} rejects the goal", client.name()))
}

/// Waits for the end of a goal; cancels it if `stop` is set or the deadline has passed.
async fn ended<A: Action>(
    handle: &GoalHandle<A>,
    deadline: Duration,
    stop: &Stop,
) -> Result<Outcome<A::Result>> {
    match stop.or(handle.result(deadline)).await {
        Some(Ok(outcome)) => Ok(outcome),
        Some(Err(error)) => {
            // Whether it can be cancelled or not, the error to tell is the first.
            let _ = handle.cancel(CANCEL_DEADLINE).await;
            Err(error.into())
        }
        None => {
            handle.cancel(CANCEL_DEADLINE).await?;
            Ok(handle.result(CANCEL_DEADLINE).await?)
        }
    }
}
