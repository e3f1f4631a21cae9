//! Clients of the other nodes.

use crate::node_services::NodeServices;
use crate::params::{ModellerParams, Params};
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
use puffer_ros::{Action, ActionClient, Client, GoalHandle, Node, Outcome, Stamp, Stop};
use std::time::Duration;

/// How long a node may take to accept a goal.
const ACCEPT_DEADLINE: Duration = Duration::from_secs(30);
/// How long a cancelled goal may take to end.
const CANCEL_DEADLINE: Duration = Duration::from_secs(10);
/// The nodes that hold scans, and forget them by `~/reset`.
const SCAN_HOLDERS: [&str; 3] = ["scan_registrar", "nbv_planner", "cloud_filter"];

/// Clients of all services and actions that modelling uses.
pub(crate) struct NodeClients {
    node: Node<Params>,
    plan_view: Client<PlanView>,
    follow_joint_trajectory: ActionClient<FollowJointTrajectory>,
    trigger_scan: Client<Trigger>,
    refine: ActionClient<Refine>,
    filter: Client<Filter>,
    reconstruct: ActionClient<ReconstructMesh>,
    resets: Vec<Client<Trigger>>,
}

/// Whether a node is there, by its name.
type Presence = (&'static str, bool);

impl NodeClients {
    pub(crate) fn new(node: &Node<Params>) -> Result<NodeClients> {
        Ok(NodeClients {
            node: node.clone(),
            plan_view: node.client("nbv_planner/plan_view")?,
            follow_joint_trajectory: node.action_client("follow_joint_trajectory")?,
            trigger_scan: node.client("trigger_scan")?,
            refine: node.action_client("scan_registrar/refine")?,
            filter: node.client("cloud_filter/filter")?,
            reconstruct: node.action_client("mesh_reconstructor/reconstruct_action")?,
            resets: SCAN_HOLDERS
                .iter()
                .map(|name| node.client(&format!("{name}/reset")))
                .collect::<Result<_>>()?,
        })
    }

    /// Waits until all nodes of a run are there.
    ///
    /// # Errors
    /// Names those that are missing after the deadline.
    pub(crate) async fn wait_for_all(&self) -> Result<()> {
        self.wait_for(|| [self.measuring_nodes(), self.meshing_nodes()].concat()).await
    }

    /// Waits until those nodes are there that make a mesh of scans that were taken.
    ///
    /// # Errors
    /// Names those that are missing after the deadline.
    pub(crate) async fn wait_for_meshing_nodes(&self) -> Result<()> {
        self.wait_for(|| self.meshing_nodes().to_vec()).await
    }

    /// Whether robot and sensor are there.
    pub(crate) fn has_driver(&self) -> bool {
        self.follow_joint_trajectory.is_ready() && self.trigger_scan.is_ready()
    }

    fn measuring_nodes(&self) -> [Presence; 3] {
        let controller = "the robot's controller (follow_joint_trajectory)";
        [
            ("nbv_planner", self.plan_view.is_ready()),
            (controller, self.follow_joint_trajectory.is_ready()),
            ("the sensor (trigger_scan)", self.trigger_scan.is_ready()),
        ]
    }

    fn meshing_nodes(&self) -> [Presence; 3] {
        [
            ("scan_registrar", self.refine.is_ready()),
            ("cloud_filter", self.filter.is_ready()),
            ("mesh_reconstructor", self.reconstruct.is_ready()),
        ]
    }

    async fn wait_for(&self, nodes: impl Fn() -> Vec<Presence>) -> Result<()> {
        let deadline = self.start_deadline();
        let waited = self.node.wait_for_matches(deadline, || {
            let nodes = nodes();
            let missing = nodes.iter().filter(|(_, is_there)| !is_there);
            let missing: Vec<&str> = missing.map(|(name, _)| *name).collect();
            if missing.is_empty() { Ok(()) } else { Err(missing.join(", ")) }
        });
        waited.await.map_err(|missing| {
            let (seconds, domain) = (deadline.as_secs_f64(), self.node.domain());
            anyhow!("not there after {seconds:.0} s on domain {domain}: {missing}")
        })
    }

    /// Has all nodes forget earlier scans.
    pub(crate) async fn reset_scans(&self) -> Result<()> {
        for client in &self.resets {
            client.call(&TriggerRequest::default(), self.start_deadline()).await?;
        }
        Ok(())
    }

    fn start_deadline(&self) -> Duration {
        Duration::from_secs_f64(self.node.params().modeller.start_deadline)
    }
}

impl NodeServices for NodeClients {
    fn params(&self) -> ModellerParams {
        self.node.params().modeller
    }

    fn now(&self) -> Stamp {
        self.node.now()
    }

    async fn plan_view(
        &self,
        request: &PlanViewRequest,
        deadline: Duration,
    ) -> Result<PlanViewResponse> {
        let response = self.plan_view.call(request, deadline).await?;
        if !response.success {
            bail!("{}", response.message);
        }
        Ok(response)
    }

    async fn follow_trajectory(
        &self,
        trajectory: &JointTrajectory,
        deadline: Duration,
        stop: &Stop,
    ) -> Result<()> {
        let goal = FollowJointTrajectoryGoal {
            trajectory: trajectory.clone(),
            ..FollowJointTrajectoryGoal::default()
        };
        let handle = send_goal(&self.follow_joint_trajectory, &goal).await?;
        match wait_for_result(&handle, deadline, stop).await? {
            Outcome::Succeeded(_) => Ok(()),
            Outcome::Aborted(result) | Outcome::Canceled(result) => {
                bail!("{} (code {})", result.error_string, result.error_code)
            }
        }
    }

    async fn trigger_scan(&self, deadline: Duration) -> Result<()> {
        let response = self.trigger_scan.call(&TriggerRequest::default(), deadline).await?;
        if !response.success {
            bail!("{}", response.message);
        }
        Ok(())
    }

    async fn refine(&self, scans: usize, deadline: Duration, stop: &Stop) -> Result<RefineResult> {
        let handle = send_goal(&self.refine, &RefineGoal { scans: scans as u32 }).await?;
        match wait_for_result(&handle, deadline, stop).await? {
            Outcome::Succeeded(result) => Ok(result),
            Outcome::Aborted(result) | Outcome::Canceled(result) => Err(anyhow!(result.error_msg)),
        }
    }

    async fn filter(
        &self,
        scans: usize,
        revision: u32,
        deadline: Duration,
    ) -> Result<FilterResponse> {
        let request = FilterRequest { scans: scans as u32, revision };
        let response = self.filter.call(&request, deadline).await?;
        if !response.success {
            bail!("{}", response.message);
        }
        Ok(response)
    }

    async fn reconstruct(
        &self,
        goal: ReconstructMeshGoal,
        deadline: Duration,
        stop: &Stop,
    ) -> Result<ReconstructMeshResult> {
        let handle = send_goal(&self.reconstruct, &goal).await?;
        match wait_for_result(&handle, deadline, stop).await? {
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

async fn send_goal<A: Action>(client: &ActionClient<A>, goal: &A::Goal) -> Result<GoalHandle<A>> {
    let handle = client.send(goal, ACCEPT_DEADLINE).await?;
    handle.with_context(|| format!("{} rejects the goal", client.name()))
}

/// Waits for the end of a goal; cancels the goal if `stop` is set or the deadline has passed.
async fn wait_for_result<A: Action>(
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
