//! The action `model_object`.

use crate::busy::Busy;
use crate::journal::Journal;
use crate::node_clients::NodeClients;
use crate::params::Params;
use crate::report::{End, model_verdict};
use crate::runner::Runner;
use crate::scan_inbox::ScanInbox;
use puffer_core::geometry::Aabb;
use puffer_core::session::{Event, Phase, SessionOutcome, SessionParams, SessionState};
use puffer_msgs::action::{
    ModelObject, ModelObjectFeedback, ModelObjectGoal, ModelObjectResult, ReconstructMeshResult,
};
use puffer_msgs::builtin_interfaces::msg::Duration as DurationMessage;
use puffer_msgs::msg::ModellingStatus;
use puffer_msgs::srv::ReconstructResponse;
use puffer_msgs::std_msgs::msg::Header;
use puffer_ros::conversions::region_from_message;
use puffer_ros::{Goal, Node, Outcome, Publisher};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use tokio::sync::mpsc::{UnboundedSender, unbounded_channel};

/// The modeller, ready for goals.
pub(crate) struct Modeller {
    pub node: Node<Params>,
    pub clients: NodeClients,
    pub inbox: Arc<ScanInbox>,
    pub status: Publisher<ModellingStatus>,
    /// The operator's controls of the running session.
    pub controls: Mutex<Option<UnboundedSender<Event>>>,
    /// Whether a session is running, or its last steps alone.
    pub busy: Busy,
}

/// Why there was no session, or no report of it.
struct Fault {
    /// A constant of [`ModelObjectResult`].
    error_code: u16,
    error: anyhow::Error,
}

impl Fault {
    /// The run folder cannot be written.
    fn in_run_folder(error: anyhow::Error) -> Fault {
        Fault { error_code: ModelObjectResult::RUN_FOLDER, error }
    }

    /// A node does not answer.
    fn of_silent_node(error: anyhow::Error) -> Fault {
        Fault { error_code: ModelObjectResult::NODE_MISSING, error }
    }
}

impl Modeller {
    /// Sends a control to the running session; false if there is none.
    pub(crate) fn control(&self, event: Event) -> bool {
        let controls = self.controls.lock().unwrap_or_else(PoisonError::into_inner);
        controls.as_ref().is_some_and(|sender| sender.send(event).is_ok())
    }

    /// Works on a goal to its end.
    pub(crate) async fn model(&self, goal: Goal<ModelObject>) -> Outcome<ModelObjectResult> {
        let (sender, controls) = unbounded_channel();
        *self.controls.lock().unwrap_or_else(PoisonError::into_inner) = Some(sender.clone());
        let watch = tokio::spawn({
            let goal = goal.clone();
            async move {
                goal.cancelled().await;
                // A session that has ended needs no cancelling.
                let _ = sender.send(Event::Cancel);
            }
        });
        let since = Instant::now();
        let ended = self.run(&goal, controls, |state, message| {
            self.publish_status(&goal, state, message, since);
        });
        let outcome = match ended.await {
            Ok((end, result)) => ended_outcome(end, result),
            Err(Fault { error_code, error }) => failed_outcome(error_code, format!("{error:#}")),
        };
        watch.abort();
        *self.controls.lock().unwrap_or_else(PoisonError::into_inner) = None;
        outcome
    }

    async fn run(
        &self,
        goal: &Goal<ModelObject>,
        controls: tokio::sync::mpsc::UnboundedReceiver<Event>,
        on_state: impl FnMut(&SessionState, &str),
    ) -> Result<(End, ModelObjectResult), Fault> {
        let since = Instant::now();
        let params = self.node.params();
        // A cancel request ends the wait for the nodes at once.
        tokio::select! {
            ready = self.prepare_nodes() => ready?,
            () = goal.cancelled() => {}
        }
        self.inbox.clear();
        let journal = Journal::create(&params, self.node.now()).map_err(Fault::in_run_folder)?;
        let (request, stop) = (goal.request().clone(), self.node.stop());
        let session = SessionState::new(session_params(&params, &request));
        let mut runner = Runner::new(&self.clients, &self.inbox, journal, request, stop);
        let first = if goal.is_cancelled() { Event::Cancel } else { Event::Ready };
        let end = runner.run(session, first, controls, on_state).await;
        runner.write_report(&end).map_err(Fault::in_run_folder)?;
        let result = ModelObjectResult {
            seconds: since.elapsed().as_secs_f32(),
            run_folder: runner.journal.folder(),
            ..result_of(&end, &runner.mesh)
        };
        Ok((end, result))
    }

    /// Waits until all nodes are there and have forgotten earlier scans.
    async fn prepare_nodes(&self) -> Result<(), Fault> {
        self.clients.wait_for_all().await.map_err(|error| {
            let error_code = if self.clients.has_driver() {
                ModelObjectResult::NODE_MISSING
            } else {
                ModelObjectResult::NO_DRIVER
            };
            Fault { error_code, error }
        })?;
        self.clients.reset_scans().await.map_err(Fault::of_silent_node)
    }

    /// Publishes the state as the goal's feedback and as `modelling_status`.
    fn publish_status(
        &self,
        goal: &Goal<ModelObject>,
        state: &SessionState,
        message: &str,
        since: Instant,
    ) {
        let feedback = ModelObjectFeedback {
            phase: phase_constant(state.phase),
            scans: state.scans as u32,
            coverage: state.coverage as f32,
            expected_gain: state.expected_gain as f32,
            elapsed: DurationMessage::from_seconds(since.elapsed().as_secs_f64()),
            message: message.to_owned(),
        };
        let status = ModellingStatus {
            header: Header { stamp: self.node.now().into(), frame_id: String::new() },
            phase: feedback.phase,
            scans: feedback.scans,
            coverage: feedback.coverage,
            expected_gain: feedback.expected_gain,
            elapsed: feedback.elapsed,
            message: feedback.message.clone(),
        };
        goal.feedback(&feedback);
        if let Err(error) = self.status.publish(&status) {
            tracing::warn!("modelling_status: {error:#}");
        }
    }
}

/// The parameters of the session that a goal asks for: the configured ones where it names none.
fn session_params(params: &Params, goal: &ModelObjectGoal) -> SessionParams {
    let mut session = params.session.clone();
    if goal.max_scans > 0 {
        session.max_scans = goal.max_scans as usize;
    }
    if goal.coverage > 0.0 {
        session.coverage = f64::from(goal.coverage).min(1.0);
    }
    if goal.sigma > 0.0 {
        session.sigma = f64::from(goal.sigma);
    }
    session
}

/// Checks a goal.
///
/// # Errors
/// What is wrong with it, in words.
pub(crate) fn check_goal(goal: &ModelObjectGoal) -> std::result::Result<(), String> {
    for (name, value) in [("coverage", goal.coverage), ("sigma", goal.sigma)] {
        if !value.is_finite() || value < 0.0 {
            return Err(format!(
                "{name} is {value}: it must be positive, or 0 for what is configured"
            ));
        }
    }
    region_from_message(&goal.roi, &Aabb::EMPTY).map(drop)
}

/// The result of a session that ended with `mesh`, but for time and folder.
fn result_of(end: &End, mesh: &ReconstructMeshResult) -> ModelObjectResult {
    let verdict = model_verdict(end, mesh);
    ModelObjectResult {
        success: mesh.success,
        error_code: error_code(&end.outcome, mesh),
        error_msg: mesh.error_msg.clone(),
        mesh_path: mesh.mesh_path.clone(),
        vertices: mesh.vertices,
        triangles: mesh.triangles,
        genus: mesh.genus,
        closed: mesh.closed,
        mean_sigma: mesh.mean_sigma,
        unobserved_share: mesh.unobserved_share,
        scans: end.state.scans as u32,
        coverage: end.state.coverage as f32,
        reason: end.state.reason.clone(),
        accepted: verdict.scans.map_or(0, |scans| scans.accepted() as u32),
        share_of_scans_accepted: share_message(verdict.scans.map(|scans| scans.share())),
        share_of_cells_explained: share_message(verdict.cells_explained),
        ..ModelObjectResult::default()
    }
}

/// A share as messages have it: NaN where it is not known.
fn share_message(share: Option<f64>) -> f32 {
    share.map_or(f32::NAN, |share| share as f32)
}

/// The constant of a phase in `ModelObject.action`.
fn phase_constant(phase: Phase) -> u8 {
    match phase {
        Phase::Preparing => ModelObjectFeedback::PREPARING,
        Phase::Planning => ModelObjectFeedback::PLANNING,
        Phase::Moving => ModelObjectFeedback::MOVING,
        Phase::Scanning => ModelObjectFeedback::SCANNING,
        Phase::Registering => ModelObjectFeedback::REGISTERING,
        Phase::Refining => ModelObjectFeedback::REFINING,
        Phase::Filtering => ModelObjectFeedback::FILTERING,
        Phase::Reconstructing => ModelObjectFeedback::RECONSTRUCTING,
        Phase::Done => ModelObjectFeedback::DONE,
        Phase::Paused => ModelObjectFeedback::PAUSED,
    }
}

/// The outcome of a goal whose session ended.
fn ended_outcome(end: End, mut result: ModelObjectResult) -> Outcome<ModelObjectResult> {
    match end.outcome {
        SessionOutcome::Modelled(reason) => {
            tracing::info!("modelled with {} scans: {reason}", end.state.scans);
            Outcome::Succeeded(result)
        }
        SessionOutcome::Cancelled => {
            result.error_msg = "cancelled".to_owned();
            Outcome::Canceled(result)
        }
        SessionOutcome::Failed(_, why) => {
            tracing::error!("{why}");
            result.error_msg = why;
            Outcome::Aborted(result)
        }
    }
}

/// The error code of a session that ended with `mesh`.
fn error_code(outcome: &SessionOutcome, mesh: &ReconstructMeshResult) -> u16 {
    let phase = match outcome {
        SessionOutcome::Modelled(_) => return ModelObjectResult::NONE,
        SessionOutcome::Cancelled => return ModelObjectResult::CANCELLED,
        SessionOutcome::Failed(_, _) if mesh.error_code == ReconstructResponse::NOT_TRUSTWORTHY => {
            return ModelObjectResult::NOT_TRUSTWORTHY;
        }
        SessionOutcome::Failed(phase, _) => phase,
    };
    match phase {
        Phase::Preparing | Phase::Paused | Phase::Done => ModelObjectResult::NO_DRIVER,
        Phase::Planning | Phase::Moving => ModelObjectResult::MOTION,
        Phase::Scanning => ModelObjectResult::NO_SCAN,
        Phase::Registering | Phase::Refining => ModelObjectResult::REGISTRATION,
        Phase::Filtering | Phase::Reconstructing => ModelObjectResult::RECONSTRUCTION,
    }
}

/// The outcome of a goal for which there was no session, or no report of it.
fn failed_outcome(error_code: u16, error_msg: String) -> Outcome<ModelObjectResult> {
    tracing::error!("{error_msg}");
    Outcome::Aborted(ModelObjectResult { error_code, error_msg, ..ModelObjectResult::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_that_is_not_trustworthy_has_a_code_of_its_own() {
        let failed = SessionOutcome::Failed(Phase::Reconstructing, "why".into());
        let refused = mesh_with(ReconstructResponse::NOT_TRUSTWORTHY);
        assert_eq!(error_code(&failed, &refused), ModelObjectResult::NOT_TRUSTWORTHY);
        let mesh = mesh_with(ReconstructResponse::NONE);
        assert_eq!(error_code(&failed, &mesh), ModelObjectResult::RECONSTRUCTION);
        assert_eq!(
            error_code(&SessionOutcome::Modelled("enough".into()), &mesh),
            ModelObjectResult::NONE
        );
        assert_eq!(error_code(&SessionOutcome::Cancelled, &mesh), ModelObjectResult::CANCELLED);
    }

    fn mesh_with(error_code: u16) -> ReconstructMeshResult {
        ReconstructMeshResult { error_code, ..ReconstructMeshResult::default() }
    }

    #[test]
    fn a_goal_overrides_what_is_configured_where_it_names_a_value() {
        let params = Params::default();
        let same = session_params(&params, &ModelObjectGoal::default());
        assert_eq!(same, params.session);
        let goal = ModelObjectGoal {
            max_scans: 3,
            coverage: 2.0,
            sigma: 0.5,
            ..ModelObjectGoal::default()
        };
        let changed = session_params(&params, &goal);
        assert_eq!((changed.max_scans, changed.coverage, changed.sigma), (3, 1.0, 0.5));
        assert!(check_goal(&goal).is_ok());
        for sigma in [-1.0, f32::NAN, f32::INFINITY] {
            let error = check_goal(&ModelObjectGoal { sigma, ..goal.clone() }).unwrap_err();
            assert!(error.contains("sigma"), "{error}");
        }
    }
}
