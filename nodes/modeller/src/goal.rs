//! The action `model_object`.

use crate::Params;
use crate::busy::Busy;
use crate::inbox::Inbox;
use crate::journal::Journal;
use crate::partners::Partners;
use crate::runner::{End, Runner, phase_constant};
use puffer_core::geometry::Aabb;
use puffer_core::session::{Event, Outcome as Ended, Phase, SessionParams, State};
use puffer_msgs::action::{
    ModelObject, ModelObjectFeedback, ModelObjectGoal, ModelObjectResult, ReconstructMeshResult,
};
use puffer_msgs::builtin_interfaces::msg::{Duration as DurationMessage, Time};
use puffer_msgs::msg::ModellingStatus;
use puffer_msgs::srv::ReconstructResponse;
use puffer_msgs::std_msgs::msg::Header;
use puffer_shell::convert::region_from_message;
use puffer_shell::{Goal, Node, Outcome, Publisher};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use tokio::sync::mpsc::{UnboundedSender, unbounded_channel};

/// The modeller, ready for goals.
pub(crate) struct Modeller {
    pub node: Node<Params>,
    pub partners: Partners,
    pub inbox: Arc<Inbox>,
    pub status: Publisher<ModellingStatus>,
    /// Where the running session takes its controls.
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

impl Modeller {
    /// Sends a control to the running session; false if there is none.
    pub(crate) fn control(&self, event: Event) -> bool {
        let controls = self.controls.lock().unwrap_or_else(PoisonError::into_inner);
        controls.as_ref().is_some_and(|sender| sender.send(event).is_ok())
    }

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
        let told = |state: &State, message: &str| self.tell(&goal, state, message, since);
        let outcome = match self.run(&goal, controls, told).await {
            Ok((end, result)) => finished(end, result),
            Err(Fault { error_code, error }) => failed(error_code, format!("{error:#}")),
        };
        watch.abort();
        *self.controls.lock().unwrap_or_else(PoisonError::into_inner) = None;
        outcome
    }

    async fn run(
        &self,
        goal: &Goal<ModelObject>,
        controls: tokio::sync::mpsc::UnboundedReceiver<Event>,
        told: impl FnMut(&State, &str),
    ) -> Result<(End, ModelObjectResult), Fault> {
        let since = Instant::now();
        let params = self.node.params();
        // Whoever asks to end while partners are awaited is heard at once.
        tokio::select! {
            ready = self.ready() => ready?,
            () = goal.cancelled() => {}
        }
        self.inbox.clear();
        let run_folder = |error| Fault { error_code: ModelObjectResult::RUN_FOLDER, error };
        let journal = Journal::begin(&params, self.node.now()).map_err(run_folder)?;
        let asked = goal.request().clone();
        let mut runner = Runner::new(&self.node, &self.partners, &self.inbox, journal, asked);
        let first = if goal.is_cancelled() { Event::Cancel } else { Event::Ready };
        let end = runner.run(session(&params, goal.request()), first, controls, told).await;
        runner.report(&end).map_err(run_folder)?;
        let mesh = &runner.mesh;
        let verdict = runner.verdict_on_all(&end);
        let share = |share: Option<f64>| share.map_or(f32::NAN, |share| share as f32);
        let result = ModelObjectResult {
            success: mesh.success,
            error_code: error_code_of(&end.outcome, mesh),
            error_msg: mesh.error_msg.clone(),
            mesh_path: mesh.mesh_path.clone(),
            vertices: mesh.vertices,
            triangles: mesh.triangles,
            genus: mesh.genus,
            closed: mesh.closed,
            mean_sigma: mesh.mean_sigma,
            unobserved_share: mesh.unobserved_share,
            seconds: since.elapsed().as_secs_f32(),
            run_folder: runner.journal.folder(),
            scans: end.state.scans as u32,
            coverage: end.state.coverage as f32,
            reason: end.state.reason.clone(),
            accepted: verdict.scans.map_or(0, |scans| scans.accepted() as u32),
            share_of_scans_accepted: share(verdict.scans.map(|scans| scans.share())),
            share_of_cells_explained: share(verdict.cells_explained),
        };
        Ok((end, result))
    }

    /// Waits until all partners are there and have forgotten earlier scans.
    async fn ready(&self) -> Result<(), Fault> {
        self.partners.ready().await.map_err(|error| {
            let error_code = if self.partners.has_driver() {
                ModelObjectResult::NODE_MISSING
            } else {
                ModelObjectResult::NO_DRIVER
            };
            Fault { error_code, error }
        })?;
        let silent = |error| Fault { error_code: ModelObjectResult::NODE_MISSING, error };
        self.partners.reset().await.map_err(silent)
    }

    fn tell(&self, goal: &Goal<ModelObject>, state: &State, message: &str, since: Instant) {
        let feedback = ModelObjectFeedback {
            phase: phase_constant(state.phase),
            scans: state.scans as u32,
            coverage: state.coverage as f32,
            expected_gain: state.expected_gain as f32,
            elapsed: DurationMessage::from_seconds(since.elapsed().as_secs_f64()),
            message: message.to_owned(),
        };
        let (sec, nanosec) = self.node.now().parts();
        let status = ModellingStatus {
            header: Header { stamp: Time { sec, nanosec }, frame_id: String::new() },
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

/// The session that a goal asks for.
fn session(params: &Params, goal: &ModelObjectGoal) -> SessionParams {
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

/// What is wrong with a goal, in words.
pub(crate) fn check(goal: &ModelObjectGoal) -> std::result::Result<(), String> {
    for (name, value) in [("coverage", goal.coverage), ("sigma", goal.sigma)] {
        if !value.is_finite() || value < 0.0 {
            return Err(format!(
                "{name} is {value}: it must be positive, or 0 for what is configured"
            ));
        }
    }
    region_from_message(&goal.roi, &Aabb::EMPTY).map(drop)
}

fn finished(end: End, mut result: ModelObjectResult) -> Outcome<ModelObjectResult> {
    match end.outcome {
        Ended::Modelled(reason) => {
            tracing::info!("modelled with {} scans: {reason}", end.state.scans);
            Outcome::Succeeded(result)
        }
        Ended::Cancelled => {
            result.error_msg = "cancelled".to_owned();
            Outcome::Canceled(result)
        }
        Ended::Failed(_, why) => {
            tracing::error!("{why}");
            result.error_msg = why;
            Outcome::Aborted(result)
        }
    }
}

fn error_code_of(outcome: &Ended, mesh: &ReconstructMeshResult) -> u16 {
    let phase = match outcome {
        Ended::Modelled(_) => return ModelObjectResult::NONE,
        Ended::Cancelled => return ModelObjectResult::CANCELLED,
        Ended::Failed(_, _) if mesh.error_code == ReconstructResponse::NOT_TRUSTWORTHY => {
            return ModelObjectResult::NOT_TRUSTWORTHY;
        }
        Ended::Failed(phase, _) => phase,
    };
    match phase {
        Phase::Preparing | Phase::Paused | Phase::Done => ModelObjectResult::NO_DRIVER,
        Phase::Planning | Phase::Moving => ModelObjectResult::MOTION,
        Phase::Scanning => ModelObjectResult::NO_SCAN,
        Phase::Registering | Phase::Refining => ModelObjectResult::REGISTRATION,
        Phase::Filtering | Phase::Reconstructing => ModelObjectResult::RECONSTRUCTION,
    }
}

fn failed(error_code: u16, error_msg: String) -> Outcome<ModelObjectResult> {
    tracing::error!("{error_msg}");
    Outcome::Aborted(ModelObjectResult { error_code, error_msg, ..ModelObjectResult::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_that_is_not_trustworthy_has_a_code_of_its_own() {
        let code = |error_code: u16, outcome: Ended| {
            error_code_of(&outcome, &ReconstructMeshResult { error_code, ..Default::default() })
        };
        let failed = || Ended::Failed(Phase::Reconstructing, "why".into());
        let refused = ReconstructResponse::NOT_TRUSTWORTHY;
        assert_eq!(code(refused, failed()), ModelObjectResult::NOT_TRUSTWORTHY);
        assert_eq!(code(0, failed()), ModelObjectResult::RECONSTRUCTION);
        assert_eq!(code(0, Ended::Modelled("enough".into())), ModelObjectResult::NONE);
        assert_eq!(code(0, Ended::Cancelled), ModelObjectResult::CANCELLED);
    }
}
