//! Carries the session's commands out and tells it what came of them.

use crate::Params;
use crate::inbox::Inbox;
use crate::journal::Journal;
use crate::partners::Partners;
use anyhow::{Result, anyhow};
use puffer_core::session::{Command, Event, Outcome, Phase, SessionParams, State, step};
use puffer_core::verdict::{ModelVerdict, ScanCount};
use puffer_msgs::action::{ModelObjectGoal, ReconstructMeshGoal, ReconstructMeshResult};
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::sensor_msgs::msg::JointState;
use puffer_msgs::srv::PlanViewRequest;
use puffer_msgs::trajectory_msgs::msg::JointTrajectory;
use puffer_shell::convert::status_from_message;
use puffer_shell::{Node, Stop};
use serde_json::{Map, Value, json};
use std::time::{Duration, Instant};
use tokio::sync::mpsc::UnboundedReceiver;

/// One modelling run.
pub(crate) struct Runner<'a> {
    pub node: &'a Node<Params>,
    pub partners: &'a Partners,
    pub inbox: &'a Inbox,
    pub journal: Journal,
    /// The way to the planned view.
    trajectory: JointTrajectory,
    goal: ModelObjectGoal,
    /// Where the robot was sent to last; no joints if it did not get there.
    sent_to: JointState,
    /// Numbers and versions of the accepted scans.
    accepted: Vec<(u32, u32)>,
    revision: u32,
    /// Scans that came before the poses were refined.
    scans: usize,
    cloud_hash: String,
    /// What was said of the mesh: of the last one that was written, if there is one.
    pub mesh: ReconstructMeshResult,
}

/// How a run ended.
pub(crate) struct End {
    pub outcome: Outcome,
    pub state: State,
}

impl<'a> Runner<'a> {
    pub(crate) fn new(
        node: &'a Node<Params>,
        partners: &'a Partners,
        inbox: &'a Inbox,
        journal: Journal,
        goal: ModelObjectGoal,
    ) -> Runner<'a> {
        Runner {
            node,
            partners,
            inbox,
            journal,
            trajectory: JointTrajectory::default(),
            goal,
            sent_to: JointState::default(),
            accepted: Vec::new(),
            revision: 0,
            scans: 0,
            cloud_hash: String::new(),
            mesh: ReconstructMeshResult::default(),
        }
    }

    /// Runs the loop to its end. `controls` brings pauses, resumes and the wish to end; `told` hears each new state.
    pub(crate) async fn run(
        &mut self,
        params: SessionParams,
        first: Event,
        mut controls: UnboundedReceiver<Event>,
        mut told: impl FnMut(&State, &str),
    ) -> End {
        let mut state = State::new(params);
        let stop = self.node.stop().child();
        let (mut command, mut event) = (None, Some(first));
        loop {
            if let Some(happened) = event.take() {
                let why = match &happened {
                    Event::Failed(why) => {
                        tracing::warn!("{why}");
                        why.clone()
                    }
                    _ => String::new(),
                };
                let (next, wanted) = step(&state, happened);
                state = next;
                command = wanted.or(command);
                told(&state, &why);
            }
            let doing = match command.take() {
                Some(Command::End(outcome)) => {
                    stop.stop();
                    return End { outcome, state };
                }
                Some(doing) => doing,
                None => Command::Hold,
            };
            // The command goes on while controls come in; only the wish to end breaks it off.
            let work = self.carry_out(&doing, &stop);
            tokio::pin!(work);
            event = loop {
                tokio::select! {
                    done = &mut work => break Some(done),
                    control = controls.recv() => {
                        let control = control.unwrap_or(Event::Cancel);
                        let (next, wanted) = step(&state, control);
                        state = next;
                        told(&state, "");
                        match wanted {
                            Some(Command::End(outcome)) => {
                                stop.stop();
                                // A robot on its way is told to stop, and heard.
                                let _ = work.await;
                                return End { outcome, state };
                            }
                            Some(next) => {
                                command = Some(next);
                                break None;
                            }
                            None => {}
                        }
                    }
                }
            };
        }
    }

    /// Does what is to be done; what came of it.
    async fn carry_out(&mut self, command: &Command, stop: &Stop) -> Event {
        let (stage, since) = (stage_of(command), Instant::now());
        let result = match command {
            Command::Plan { scans, factor } => self.plan(*scans, *factor).await,
            Command::Move => self.drive(stop).await,
            Command::Scan => self.partners.trigger().await.map(|()| Event::Scanned),
            Command::AwaitVerdict { index } => self.verdict(*index).await,
            Command::Refine { scans } => self.refine(*scans, stop).await,
            Command::Filter { scans } => self.filter(*scans).await,
            Command::Reconstruct => self.reconstruct(stop).await,
            Command::Hold | Command::End(_) => {
                stop.stopped().await;
                Ok(Event::Cancel)
            }
        };
        self.journal.took(stage, since.elapsed());
        self.journal.note(&format!("{stage}_seconds"), since.elapsed().as_secs_f64());
        result.unwrap_or_else(|error| {
            // What the end of the node breaks off has not failed.
            if self.node.stop().is_stopped() {
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
        let plan = self.partners.plan(&request).await?;
        self.journal.planned(&plan);
        self.journal.note("planned_at_simulated_seconds", self.node.now().seconds());
        let coverage = f64::from(plan.coverage);
        if plan.done {
            return Ok(Event::NothingLeft { coverage, reason: plan.message });
        }
        self.trajectory = plan.trajectory;
        Ok(Event::Planned { coverage, gain: f64::from(plan.expected_gain) })
    }

    async fn drive(&mut self, stop: &Stop) -> Result<Event> {
        self.sent_to = JointState::default();
        self.partners.drive(&self.trajectory, stop).await?;
        if let Some(end) = self.trajectory.points.last() {
            self.sent_to.name = self.trajectory.joint_names.clone();
            self.sent_to.position = end.positions.clone();
        }
        Ok(Event::Moved)
    }

    async fn verdict(&mut self, index: usize) -> Result<Event> {
        let deadline = Duration::from_secs_f64(self.node.params().modeller.register_deadline);
        let first = self.inbox.wait_for(index as u32, deadline).await?;
        let status = status_from_message(first.status).map_err(anyhow::Error::msg)?;
        self.accepted = first.accepted.into_iter().zip(first.accepted_versions).collect();
        self.keep()?;
        self.journal.write(self.node.now(), &Map::new())?;
        Ok(Event::Registered(status))
    }

    /// Keeps all scans that came.
    fn keep(&mut self) -> Result<()> {
        for scan in self.inbox.take_new() {
            self.journal.keep(&scan)?;
        }
        Ok(())
    }

    async fn refine(&mut self, scans: usize, stop: &Stop) -> Result<Event> {
        let refined = self.partners.refine(scans, stop).await?;
        self.revision = refined.revision;
        self.scans = scans;
        let told: Vec<(u32, u32)> = refined.ids.into_iter().zip(refined.versions).collect();
        let accepted = |status: &u8| *status == RegisteredScan::ACCEPTED;
        let verdicts = told.iter().zip(&refined.status);
        self.accepted = verdicts.filter(|(_, s)| accepted(s)).map(|(scan, _)| *scan).collect();
        let deadline = Duration::from_secs_f64(self.node.params().modeller.register_deadline);
        if let Err(error) = self.inbox.wait_for_versions(&told, deadline).await {
            // The mesh does not need them here: the filter has its own.
            tracing::warn!("the run folder holds older points: {error}");
        }
        Ok(Event::Finished)
    }

    async fn filter(&mut self, scans: usize) -> Result<Event> {
        let filtered = self.partners.filter(scans, self.revision).await?;
        self.cloud_hash = filtered.cloud_hash;
        Ok(Event::Finished)
    }

    async fn reconstruct(&mut self, stop: &Stop) -> Result<Event> {
        let goal = ReconstructMeshGoal {
            cloud_hash: self.cloud_hash.clone(),
            roi: self.goal.roi,
            scans: self.scans as u32,
            accepted: self.accepted.len() as u32,
            force: self.goal.force,
            ..ReconstructMeshGoal::default()
        };
        let mesh = self.partners.reconstruct(goal, stop).await?;
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

    /// The verdict on the whole of a run that ended.
    pub(crate) fn verdict_on_all(&self, end: &End) -> ModelVerdict {
        let mesh = &self.mesh;
        if mesh.scans == 0 {
            // It did not come to a mesh: what is known is told.
            let scans = ScanCount::new(end.state.scans, end.state.accepted);
            return ModelVerdict { scans, cells_explained: None };
        }
        let explained = Some(f64::from(mesh.share_of_cells_explained));
        ModelVerdict {
            scans: ScanCount::new(mesh.scans as usize, mesh.accepted as usize),
            cells_explained: explained.filter(|share| share.is_finite()),
        }
    }

    /// Writes the report of a run that ended.
    pub(crate) fn report(&mut self, end: &End) -> Result<()> {
        self.keep()?;
        let verdict = self.verdict_on_all(end);
        let mut facts = verdict.facts();
        let (outcome, reason) = match &end.outcome {
            Outcome::Modelled(reason) => ("modelled", reason.clone()),
            Outcome::Failed(..) if !self.mesh.success && self.mesh.vertices > 0 => {
                ("not trustworthy", end.state.reason.clone())
            }
            Outcome::Failed(phase, reason) => ("failed", format!("{phase:?}: {reason}")),
            Outcome::Cancelled => ("cancelled", "on request".to_owned()),
        };
        for (key, value) in [
            ("outcome", json!(outcome)),
            ("reason", json!(reason)),
            ("scans", json!(verdict.scans.map_or(end.state.scans, |scans| scans.all()))),
            ("accepted_scans", json!(verdict.scans.map_or(0, |scans| scans.accepted()))),
            ("coverage", json!(end.state.coverage)),
            ("mesh", mesh_facts(&self.mesh)),
        ] {
            facts.insert(key.to_owned(), value);
        }
        self.journal.write(self.node.now(), &facts)
    }
}

fn mesh_facts(mesh: &ReconstructMeshResult) -> Value {
    if !mesh.success {
        return Value::Null;
    }
    json!({
        "path": mesh.mesh_path,
        "vertices": mesh.vertices,
        "triangles": mesh.triangles,
        "genus": mesh.genus,
        "closed": mesh.closed,
        "mean_sigma": mesh.mean_sigma,
        "unobserved_share": mesh.unobserved_share,
        "seconds": mesh.seconds,
    })
}

fn stage_of(command: &Command) -> &'static str {
    match command {
        Command::Plan { .. } => "plan",
        Command::Move => "move",
        Command::Scan => "scan",
        Command::AwaitVerdict { .. } => "register",
        Command::Refine { .. } => "refine",
        Command::Filter { .. } => "filter",
        Command::Reconstruct => "reconstruct",
        Command::Hold | Command::End(_) => "hold",
    }
}

/// The constant of a phase in `ModelObject.action`.
pub(crate) fn phase_constant(phase: Phase) -> u8 {
    use puffer_msgs::action::ModelObjectFeedback as F;
    match phase {
        Phase::Preparing => F::PREPARING,
        Phase::Planning => F::PLANNING,
        Phase::Moving => F::MOVING,
        Phase::Scanning => F::SCANNING,
        Phase::Registering => F::REGISTERING,
        Phase::Refining => F::REFINING,
        Phase::Filtering => F::FILTERING,
        Phase::Reconstructing => F::RECONSTRUCTING,
        Phase::Done => F::DONE,
        Phase::Paused => F::PAUSED,
    }
}
