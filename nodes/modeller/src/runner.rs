//! Carries out the commands of a session and reports to it how they went.

use crate::journal::Journal;
use crate::node_services::NodeServices;
use crate::report::{End, report_facts};
use crate::scan_inbox::ScanInbox;
use anyhow::{Result, anyhow};
use puffer_core::session::{Command, Event, SessionState, step};
use puffer_msgs::action::{ModelObjectGoal, ReconstructMeshGoal, ReconstructMeshResult};
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::sensor_msgs::msg::JointState;
use puffer_msgs::srv::PlanViewRequest;
use puffer_msgs::trajectory_msgs::msg::JointTrajectory;
use puffer_ros::Stop;
use puffer_ros::conversions::status_from_message;
use serde_json::Map;
use std::time::{Duration, Instant};
use tokio::sync::mpsc::UnboundedReceiver;

/// One modelling run.
pub(crate) struct Runner<'a, S> {
    services: &'a S,
    inbox: &'a ScanInbox,
    pub journal: Journal,
    /// Ends the node.
    node_stop: Stop,
    goal: ModelObjectGoal,
    /// The motion to the planned view.
    trajectory: JointTrajectory,
    /// Where the robot was sent to last; no joints if it did not get there.
    sent_to: JointState,
    /// Numbers and versions of the accepted scans.
    accepted: Vec<(u32, u32)>,
    /// Number of scans whose poses were refined last, and the revision of these poses.
    refined_scans: usize,
    revision: u32,
    cloud_hash: String,
    /// Result of the newest mesh that was written; without any, of the newest that was refused.
    pub mesh: ReconstructMeshResult,
}

/// A session and its operator.
struct Steering<F> {
    state: SessionState,
    /// Pauses, resumes and the wish to end.
    controls: UnboundedReceiver<Event>,
    /// Called with each new state, and why a step failed; empty if none did.
    on_state: F,
}

impl<F: FnMut(&SessionState, &str)> Steering<F> {
    /// The command that follows from `event`.
    fn advance(&mut self, event: Event) -> Command {
        let why = match &event {
            Event::Failed(why) => {
                tracing::warn!("{why}");
                why.clone()
            }
            _ => String::new(),
        };
        self.apply(event, &why).unwrap_or(Command::WaitForResume)
    }

    fn apply(&mut self, event: Event, why: &str) -> Option<Command> {
        let (next, command) = step(&self.state, event);
        self.state = next;
        (self.on_state)(&self.state, why);
        command
    }
}

impl<'a, S: NodeServices> Runner<'a, S> {
    /// A run for `goal` that has not begun; `node_stop` ends it.
    pub(crate) fn new(
        services: &'a S,
        inbox: &'a ScanInbox,
        journal: Journal,
        goal: ModelObjectGoal,
        node_stop: Stop,
    ) -> Self {
        Runner {
            services,
            inbox,
            journal,
            node_stop,
            goal,
            trajectory: JointTrajectory::default(),
            sent_to: JointState::default(),
            accepted: Vec::new(),
            refined_scans: 0,
            revision: 0,
            cloud_hash: String::new(),
            mesh: ReconstructMeshResult::default(),
        }
    }

    /// Runs the session `state` from the event `first` to its end. `controls` brings pauses,
    /// resumes and the wish to end. `on_state` is called with each new state and the reason why a
    /// step failed, which is empty if none did.
    pub(crate) async fn run(
        &mut self,
        state: SessionState,
        first: Event,
        controls: UnboundedReceiver<Event>,
        on_state: impl FnMut(&SessionState, &str),
    ) -> End {
        let stop = self.node_stop.child();
        let mut steering = Steering { state, controls, on_state };
        let mut command = steering.advance(first);
        loop {
            if let Command::End(outcome) = command {
                stop.stop();
                return End { outcome, state: steering.state };
            }
            command = self.carry_out_steered(&command, &mut steering, &stop).await;
        }
    }

    /// Carries out `command` while controls come in, of which only the wish to end breaks it off;
    /// the next command.
    async fn carry_out_steered(
        &mut self,
        command: &Command,
        steering: &mut Steering<impl FnMut(&SessionState, &str)>,
        stop: &Stop,
    ) -> Command {
        let work = self.carry_out(command, stop);
        tokio::pin!(work);
        loop {
            tokio::select! {
                done = &mut work => return steering.advance(done),
                control = steering.controls.recv() => {
                    match steering.apply(control.unwrap_or(Event::Cancel), "") {
                        Some(end @ Command::End(_)) => {
                            // A moving robot is told to stop, and its answer awaited.
                            stop.stop();
                            let _ = work.await;
                            return end;
                        }
                        Some(next) => return next,
                        None => {}
                    }
                }
            }
        }
    }

    /// Carries out `command`; the event that reports how it went.
    async fn carry_out(&mut self, command: &Command, stop: &Stop) -> Event {
        let (stage, since) = (stage_name(command), Instant::now());
        let result = match command {
            Command::Plan { scans, point_factor: factor } => self.plan(*scans, *factor).await,
            Command::Move => self.move_robot(stop).await,
            Command::Scan => self.scan().await,
            Command::AwaitVerdict { index } => self.await_verdict(*index).await,
            Command::Refine { scans } => self.refine(*scans, stop).await,
            Command::Filter { scans } => self.filter(*scans).await,
            Command::Reconstruct => self.reconstruct(stop).await,
            Command::WaitForResume | Command::End(_) => {
                stop.stopped().await;
                Ok(Event::Cancel)
            }
        };
        self.journal.add_stage_time(stage, since.elapsed());
        self.journal.note(&format!("{stage}_seconds"), since.elapsed().as_secs_f64());
        result.unwrap_or_else(|error| {
            // What the end of the node breaks off has not failed.
            if self.node_stop.is_stopped() {
                Event::Cancel
            } else {
                Event::Failed(format!("{error:#}"))
            }
        })
    }

    async fn plan(&mut self, scans: usize, factor: usize) -> Result<Event> {
        let request = PlanViewRequest {
            scans: scans as u32,
            revision: self.revision,
            point_factor: factor as u32,
            roi: self.goal.roi,
            scans_listed: true,
            accepted: self.accepted.iter().map(|(id, _)| *id).collect(),
            accepted_versions: self.accepted.iter().map(|(_, version)| *version).collect(),
            sent_to: self.sent_to.clone(),
            ..PlanViewRequest::default()
        };
        let deadline = Duration::from_secs_f64(self.services.params().plan_deadline);
        let plan = self.services.plan_view(&request, deadline).await?;
        self.journal.begin_view(&plan);
        self.journal.note("planned_at_simulated_seconds", self.services.now().seconds());
        let coverage = f64::from(plan.coverage);
        if plan.done {
            return Ok(Event::NoViewLeft { coverage, reason: plan.message });
        }
        self.trajectory = plan.trajectory;
        Ok(Event::Planned { coverage, gain: f64::from(plan.expected_gain) })
    }

    async fn move_robot(&mut self, stop: &Stop) -> Result<Event> {
        self.sent_to = JointState::default();
        let deadline = Duration::from_secs_f64(self.services.params().move_deadline)
            + duration_of(&self.trajectory);
        self.services.follow_trajectory(&self.trajectory, deadline, stop).await?;
        if let Some(end) = self.trajectory.points.last() {
            self.sent_to.name = self.trajectory.joint_names.clone();
            self.sent_to.position = end.positions.clone();
        }
        Ok(Event::Moved)
    }

    async fn scan(&self) -> Result<Event> {
        let deadline = Duration::from_secs_f64(self.services.params().scan_deadline);
        self.services.trigger_scan(deadline).await?;
        Ok(Event::Scanned)
    }

    async fn await_verdict(&mut self, index: usize) -> Result<Event> {
        let first = self.inbox.wait_for(index as u32, self.register_deadline()).await?;
        let status = status_from_message(first.status).map_err(anyhow::Error::msg)?;
        self.accepted = first.accepted.into_iter().zip(first.accepted_versions).collect();
        self.keep_new_scans()?;
        self.journal.write(self.services.now(), &Map::new())?;
        Ok(Event::Registered(status))
    }

    fn register_deadline(&self) -> Duration {
        Duration::from_secs_f64(self.services.params().register_deadline)
    }

    /// Has the journal keep all scans that came since the last call.
    pub(crate) fn keep_new_scans(&mut self) -> Result<()> {
        for scan in self.inbox.take_new() {
            self.journal.keep(&scan)?;
        }
        Ok(())
    }

    async fn refine(&mut self, scans: usize, stop: &Stop) -> Result<Event> {
        let deadline = Duration::from_secs_f64(self.services.params().refine_deadline);
        let refined = self.services.refine(scans, deadline, stop).await?;
        self.revision = refined.revision;
        self.refined_scans = scans;
        let moved: Vec<(u32, u32)> = refined.ids.into_iter().zip(refined.versions).collect();
        let verdicts = moved.iter().zip(&refined.status);
        self.accepted = verdicts
            .filter(|(_, status)| **status == RegisteredScan::ACCEPTED)
            .map(|(scan, _)| *scan)
            .collect();
        if let Err(error) = self.inbox.wait_for_versions(&moved, self.register_deadline()).await {
            // The mesh does not need them here: the filter has its own.
            tracing::warn!("the run folder holds older points: {error}");
        }
        Ok(Event::Finished)
    }

    async fn filter(&mut self, scans: usize) -> Result<Event> {
        // Scans that came since are not in the revision, but must not be missed by the filter
        // either.
        let scans = scans.max(self.inbox.len());
        let deadline = Duration::from_secs_f64(self.services.params().filter_deadline);
        let filtered = self.services.filter(scans, self.revision, deadline).await?;
        self.cloud_hash = filtered.cloud_hash;
        Ok(Event::Finished)
    }

    async fn reconstruct(&mut self, stop: &Stop) -> Result<Event> {
        let params = self.services.params();
        let goal = ReconstructMeshGoal {
            output_path: params.mesh_path,
            cloud_hash: self.cloud_hash.clone(),
            roi: self.goal.roi,
            scans: self.refined_scans as u32,
            accepted: self.accepted.len() as u32,
            force: self.goal.force,
            ..ReconstructMeshGoal::default()
        };
        let deadline = Duration::from_secs_f64(params.reconstruct_deadline);
        let mesh = self.services.reconstruct(goal, deadline, stop).await?;
        if mesh.success || !self.mesh.success {
            self.mesh = mesh.clone();
        }
        if !mesh.success {
            return Err(anyhow!("{}", mesh.error_msg));
        }
        if !mesh.error_msg.is_empty() {
            tracing::warn!("{}", mesh.error_msg);
        }
        Ok(Event::Reconstructed { sigma: f64::from(mesh.mean_sigma) })
    }

    /// Writes the report of a run that ended.
    pub(crate) fn write_report(&mut self, end: &End) -> Result<()> {
        self.keep_new_scans()?;
        self.journal.write(self.services.now(), &report_facts(end, &self.mesh))
    }
}

/// How long a trajectory takes.
fn duration_of(trajectory: &JointTrajectory) -> Duration {
    let end = trajectory.points.last().map(|point| point.time_from_start);
    let seconds = end.map_or(0.0, |end| f64::from(end.sec) + f64::from(end.nanosec) * 1e-9);
    Duration::from_secs_f64(seconds.max(0.0))
}

/// The name of a command's stage in reports.
fn stage_name(command: &Command) -> &'static str {
    match command {
        Command::Plan { .. } => "plan",
        Command::Move => "move",
        Command::Scan => "scan",
        Command::AwaitVerdict { .. } => "register",
        Command::Refine { .. } => "refine",
        Command::Filter { .. } => "filter",
        Command::Reconstruct => "reconstruct",
        Command::WaitForResume | Command::End(_) => "hold",
    }
}
