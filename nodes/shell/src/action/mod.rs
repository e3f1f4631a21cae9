//! Actions.

use crate::{Action, CallError};
use std::marker::PhantomData;
use std::time::Duration;

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
    goal: A::Goal,
}

impl<A: Action> Goal<A> {
    /// What the client asks for.
    pub fn request(&self) -> &A::Goal {
        &self.goal
    }

    /// Tells the client how far it is.
    pub fn feedback(&self, feedback: &A::Feedback) {
        let _ = feedback;
    }

    /// Whether the client has asked to give up, or the node stops.
    pub fn is_cancelled(&self) -> bool {
        false
    }

    /// Resolves when the client asks to give up, or the node stops.
    pub async fn cancelled(&self) {}
}

/// Sends goals to an action server; clones share it.
#[derive(Clone)]
pub struct ActionClient<A> {
    action: PhantomData<fn(A)>,
}

impl<A: Action> ActionClient<A> {
    /// Sends a goal; `None` if the server rejects it.
    ///
    /// # Errors
    /// No server or no answer within `deadline` (wall time), or the node stops.
    pub async fn send(
        &self,
        goal: &A::Goal,
        deadline: Duration,
    ) -> Result<Option<GoalHandle<A>>, CallError> {
        let _ = goal;
        Err(CallError::NoServer { service: String::new(), domain: 0, deadline })
    }

    /// Whether a server is matched now.
    pub fn is_ready(&self) -> bool {
        false
    }

    /// Absolute name of the action.
    pub fn name(&self) -> &str {
        ""
    }
}

/// An accepted goal, as its client sees it.
pub struct GoalHandle<A: Action> {
    action: PhantomData<fn(A)>,
}

impl<A: Action> GoalHandle<A> {
    /// The next feedback for this goal; `None` once the goal has ended or the node stops.
    pub async fn feedback(&mut self) -> Option<A::Feedback> {
        None
    }

    /// Waits for the goal's end.
    ///
    /// # Errors
    /// No end within `deadline` (wall time), the server has died, or the node stops.
    pub async fn result(&self, deadline: Duration) -> Result<Outcome<A::Result>, CallError> {
        Err(CallError::NoServer { service: String::new(), domain: 0, deadline })
    }

    /// Asks the server to give up; `false` if the goal had ended already. The goal's end comes by
    /// [`GoalHandle::result`].
    ///
    /// # Errors
    /// No answer within `deadline`, or the node stops.
    pub async fn cancel(&self, deadline: Duration) -> Result<bool, CallError> {
        Err(CallError::NoServer { service: String::new(), domain: 0, deadline })
    }
}
