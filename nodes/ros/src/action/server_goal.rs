//! A goal, as its server sees it.

use super::action_context::GoalId;
use crate::Stop;
use crate::dds::{Writer, encode};
use puffer_core::Progress;
use puffer_msgs::unique_identifier_msgs::msg::UUID;
use puffer_msgs::{Action, FeedbackMessage};
use std::ops::Deref;
use std::sync::Arc;
use tokio::task::JoinHandle;

/// How a goal ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome<R> {
    /// The goal was reached.
    Succeeded(R),
    /// The server gave the goal up.
    Aborted(R),
    /// The goal was given up because the client asked for it.
    Canceled(R),
}

/// An accepted goal, as its server sees it; see
/// [`Node::action_server`](crate::Node::action_server). Clones share the goal.
pub struct Goal<A: Action> {
    shared: Arc<GoalState<A>>,
}

struct GoalState<A: Action> {
    id: GoalId,
    goal: A::Goal,
    cancel: Stop,
    feedback: Arc<Writer>,
}

impl<A: Action> Clone for Goal<A> {
    fn clone(&self) -> Self {
        Self { shared: Arc::clone(&self.shared) }
    }
}

impl<A: Action> Goal<A> {
    pub(super) fn new(id: GoalId, goal: A::Goal, cancel: Stop, feedback: Arc<Writer>) -> Self {
        Self { shared: Arc::new(GoalState { id, goal, cancel, feedback }) }
    }

    /// The flag that asks the goal's work to end.
    pub(super) fn cancel_flag(&self) -> Stop {
        self.shared.cancel.clone()
    }

    /// The goal message that the client sent.
    pub fn request(&self) -> &A::Goal {
        &self.shared.goal
    }

    /// Sends feedback to the client. Feedback that cannot be sent is logged and lost.
    pub fn feedback(&self, feedback: &A::Feedback) {
        let goal_id = UUID { uuid: self.shared.id };
        let sent = encode(&FeedbackMessage { goal_id, feedback: feedback.clone() })
            .and_then(|body| self.shared.feedback.write(body, None));
        if let Err(error) = sent {
            tracing::warn!("feedback of {} lost: {error}", A::TYPE_NAME);
        }
    }

    /// Whether the client has asked to cancel the goal, or the node stops.
    pub fn is_cancelled(&self) -> bool {
        self.shared.cancel.is_stopped()
    }

    /// Resolves when the client asks to cancel the goal, or the node stops.
    pub async fn cancelled(&self) {
        self.shared.cancel.stopped().await;
    }

    /// The progress of long work on this goal: `feedback` makes the feedback message from the name
    /// of a stage and the fraction of it that is done, and cancelling the goal cancels the work.
    pub fn progress(
        &self,
        feedback: impl Fn(&str, f64) -> A::Feedback + Send + Sync + 'static,
    ) -> GoalProgress {
        let goal = self.clone();
        let progress = Progress::with_listener(move |stage, fraction| {
            goal.feedback(&feedback(stage, fraction));
        });
        let watch = tokio::spawn({
            let (goal, progress) = (self.clone(), progress.clone());
            async move {
                goal.cancelled().await;
                progress.cancel();
            }
        });
        GoalProgress { progress, watch }
    }
}

/// The progress of the work on a goal; [`Goal::progress`] returns it. Dropping it, when the work
/// has ended, ends the watch for a cancel request.
pub struct GoalProgress {
    progress: Progress,
    watch: JoinHandle<()>,
}

impl Deref for GoalProgress {
    type Target = Progress;

    fn deref(&self) -> &Progress {
        &self.progress
    }
}

impl Drop for GoalProgress {
    fn drop(&mut self) {
        self.watch.abort();
    }
}
