//! A goal as its server sees it.

use super::GoalId;
use crate::Stop;
use crate::dds::{Writer, encode};
use puffer_msgs::unique_identifier_msgs::msg::UUID;
use puffer_msgs::{Action, FeedbackMessage};
use std::sync::Arc;

/// How a goal ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome<R> {
    /// Reached.
    Succeeded(R),
    /// Given up by the server.
    Aborted(R),
    /// Given up because the client asked for it.
    Canceled(R),
}

/// An accepted goal, as its server sees it; clones share it.
pub struct Goal<A: Action> {
    shared: Arc<Shared<A>>,
}

struct Shared<A: Action> {
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
        Self { shared: Arc::new(Shared { id, goal, cancel, feedback }) }
    }

    pub(super) fn flag(&self) -> Stop {
        self.shared.cancel.clone()
    }

    /// What the client asks for.
    pub fn request(&self) -> &A::Goal {
        &self.shared.goal
    }

    /// Tells the client how far it is. A feedback that cannot be sent is logged and lost.
    pub fn feedback(&self, feedback: &A::Feedback) {
        let goal_id = UUID { uuid: self.shared.id };
        let sent = encode(&FeedbackMessage { goal_id, feedback: feedback.clone() })
            .and_then(|body| self.shared.feedback.write(body, None));
        if let Err(error) = sent {
            tracing::warn!("feedback of {} lost: {error}", A::TYPE_NAME);
        }
    }

    /// Whether the client has asked to give up, or the node stops.
    pub fn is_cancelled(&self) -> bool {
        self.shared.cancel.is_stopped()
    }

    /// Resolves when the client asks to give up, or the node stops.
    pub async fn cancelled(&self) {
        self.shared.cancel.stopped().await;
    }
}
