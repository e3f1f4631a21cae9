//! The client of an action.

use super::Outcome;
use super::action_context::{ActionContext, GoalId, feedback_type};
use crate::dds::Reader;
use crate::{CallError, Client, Stop, qos};
use anyhow::Result;
use puffer_msgs::action_msgs::msg::{GoalInfo, GoalStatus};
use puffer_msgs::action_msgs::srv::{CancelGoal, CancelGoalRequest};
use puffer_msgs::unique_identifier_msgs::msg::UUID;
use puffer_msgs::{Action, FeedbackMessage, GetResultRequest, GetResultResponse, SendGoalRequest};
use rustdds::GUID;
use rustdds::policy::Durability;
use std::collections::BTreeMap;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::sync::watch;

/// Depth of the queue of feedback in DDS; feedback is taken from it at once.
const FEEDBACK_QOS_DEPTH: i32 = 100;
/// How long a goal waits for the feedback topic's match, without which its first feedback would be
/// lost.
const MAX_FEEDBACK_MATCH_WAIT: Duration = Duration::from_secs(1);

/// Where the feedback of each goal goes.
type Listeners<F> = Mutex<BTreeMap<GoalId, UnboundedSender<F>>>;
/// How a goal ended: `None` until it has.
type End<R> = Option<Result<GetResultResponse<R>, CallError>>;

/// Sends goals of the action `A` to its server. Clones share the client.
///
/// It is made by [`Node::action_client`](crate::Node::action_client).
pub struct ActionClient<A: Action> {
    inner: Arc<ActionClientState<A>>,
}

impl<A: Action> Clone for ActionClient<A> {
    fn clone(&self) -> Self {
        Self { inner: Arc::clone(&self.inner) }
    }
}

struct ActionClientState<A: Action> {
    name: String,
    send_goal: Client<A::SendGoal>,
    cancel_goal: Client<CancelGoal>,
    get_result: Client<A::GetResult>,
    feedback_reader: GUID,
    listeners: Arc<Listeners<A::Feedback>>,
    /// Ends the task that reads feedback.
    dropped: Stop,
    stop: Stop,
}

impl<A: Action> Drop for ActionClientState<A> {
    fn drop(&mut self) {
        self.dropped.stop();
    }
}

impl<A: Action> ActionClientState<A> {
    /// Waits until the feedback topic is matched. A server that has no feedback topic is asked all
    /// the same.
    async fn match_feedback(&self, deadline: Duration) {
        let reader = self.feedback_reader;
        let matched = self.send_goal.matches().wait(|matches| matches.count(reader) > 0);
        let _ = tokio::time::timeout(deadline, matched).await;
    }
}

impl<A: Action> ActionClient<A> {
    pub(crate) fn new(context: ActionContext<'_>) -> Result<Self> {
        let feedback_qos = qos::build(true, Durability::Volatile, FEEDBACK_QOS_DEPTH);
        let feedback =
            context.dds.reader(&context.feedback_topic(), &feedback_type::<A>(), &feedback_qos)?;
        let (dds, mapping, domain, stop) =
            (context.dds, context.mapping, context.domain, context.stop);
        let inner = Arc::new(ActionClientState {
            name: context.name.to_owned(),
            send_goal: Client::new(
                dds,
                mapping,
                domain,
                &context.endpoint_name("send_goal"),
                stop,
            )?,
            cancel_goal: Client::new(
                dds,
                mapping,
                domain,
                &context.endpoint_name("cancel_goal"),
                stop,
            )?,
            get_result: Client::new(
                dds,
                mapping,
                domain,
                &context.endpoint_name("get_result"),
                stop,
            )?,
            feedback_reader: feedback.guid(),
            listeners: Arc::default(),
            dropped: stop.child(),
            stop: stop.clone(),
        });
        let listeners = Arc::clone(&inner.listeners);
        tokio::spawn(dispatch_feedback::<A>(
            feedback,
            listeners,
            inner.name.clone(),
            inner.dropped.clone(),
        ));
        Ok(Self { inner })
    }

    /// Sends a goal. Returns `None` if the server rejects it.
    ///
    /// # Errors
    /// No server or no answer within `deadline` (wall time), or the own node stops.
    pub async fn send(
        &self,
        goal: &A::Goal,
        deadline: Duration,
    ) -> Result<Option<GoalHandle<A>>, CallError> {
        let inner = &self.inner;
        let id = random_goal_id();
        let (listener, feedback) = unbounded_channel();
        inner.listeners.lock().unwrap_or_else(PoisonError::into_inner).insert(id, listener);
        let (end, ended) = watch::channel(None);
        let handle =
            GoalHandle { inner: Arc::clone(inner), id, feedback, ended, dropped: Stop::new() };
        let request = SendGoalRequest { goal_id: UUID { uuid: id }, goal: goal.clone() };
        let start = Instant::now();
        inner.match_feedback(deadline.min(MAX_FEEDBACK_MATCH_WAIT)).await;
        let left = deadline.saturating_sub(start.elapsed());
        if !inner
            .send_goal
            .call(&request, left)
            .await
            .map_err(|e| e.with_deadline(deadline))?
            .accepted
        {
            return Ok(None);
        }
        let (get_result, dropped) = (inner.get_result.clone(), handle.dropped.clone());
        tokio::spawn(async move {
            let request = GetResultRequest { goal_id: UUID { uuid: id } };
            if let Some(answer) = dropped.or(get_result.call_known(&request)).await {
                end.send_replace(Some(answer));
            }
        });
        Ok(Some(handle))
    }

    /// Whether DDS has matched a server with this client.
    pub fn is_ready(&self) -> bool {
        let inner = &self.inner;
        inner.send_goal.is_ready() && inner.cancel_goal.is_ready() && inner.get_result.is_ready()
    }

    /// The action's absolute name.
    pub fn name(&self) -> &str {
        &self.inner.name
    }
}

/// An accepted goal, as its client sees it; [`ActionClient::send`] returns it. Dropping it does not
/// cancel the goal.
pub struct GoalHandle<A: Action> {
    inner: Arc<ActionClientState<A>>,
    id: GoalId,
    feedback: UnboundedReceiver<A::Feedback>,
    ended: watch::Receiver<End<A::Result>>,
    /// Ends the task that waits for the result.
    dropped: Stop,
}

impl<A: Action> Drop for GoalHandle<A> {
    fn drop(&mut self) {
        self.dropped.stop();
        self.inner.listeners.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.id);
    }
}

impl<A: Action> GoalHandle<A> {
    /// The next feedback of this goal. Returns `None` once the goal has ended, its server has died
    /// or the own node stops.
    pub async fn feedback(&mut self) -> Option<A::Feedback> {
        tokio::select! {
            biased;
            feedback = self.feedback.recv() => feedback,
            _ = self.ended.wait_for(Option::is_some) => None,
            () = self.inner.stop.stopped() => None,
        }
    }

    /// Waits for the goal's end. It may be called again.
    ///
    /// # Errors
    /// No end within `deadline` (wall time), the server has died, or the own node stops.
    pub async fn result(&self, deadline: Duration) -> Result<Outcome<A::Result>, CallError> {
        let service = self.inner.get_result.name();
        let mut ended = self.ended.clone();
        let end = tokio::time::timeout(deadline, ended.wait_for(Option::is_some)).await;
        let end = match end {
            Ok(Ok(end)) => end.clone(),
            Ok(Err(_)) => None,
            Err(_) => {
                return Err(CallError::NoResult { action: self.inner.name.clone(), deadline });
            }
        };
        let answer =
            end.unwrap_or_else(|| Err(CallError::Stopped { service: service.to_owned() }))?;
        match answer.status {
            GoalStatus::STATUS_SUCCEEDED => Ok(Outcome::Succeeded(answer.result)),
            GoalStatus::STATUS_ABORTED => Ok(Outcome::Aborted(answer.result)),
            GoalStatus::STATUS_CANCELED => Ok(Outcome::Canceled(answer.result)),
            status => Err(CallError::Transport {
                service: service.to_owned(),
                message: format!(
                    "the server does not know the goal (status {status}); did it restart?"
                ),
            }),
        }
    }

    /// Asks the server to cancel the goal. Returns `false` if the goal had ended already or the
    /// server refuses. The goal's end comes by [`GoalHandle::result`].
    ///
    /// # Errors
    /// No answer within `deadline` (wall time), or the own node stops.
    pub async fn cancel(&self, deadline: Duration) -> Result<bool, CallError> {
        let goal_id = UUID { uuid: self.id };
        let goal_info = GoalInfo { goal_id, ..Default::default() };
        let answer =
            self.inner.cancel_goal.call(&CancelGoalRequest { goal_info }, deadline).await?;
        Ok(answer.goals_canceling.iter().any(|goal| goal.goal_id == goal_id))
    }
}

/// Hands feedback to the handles of the goals that it is for.
async fn dispatch_feedback<A: Action>(
    reader: Reader,
    listeners: Arc<Listeners<A::Feedback>>,
    name: String,
    stop: Stop,
) {
    while let Some(sample) = stop.or(reader.next()).await {
        let message = sample.and_then(|s| s.payload.decode::<FeedbackMessage<A::Feedback>>());
        match message {
            Ok(message) => {
                let listeners = listeners.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(listener) = listeners.get(&message.goal_id.uuid) {
                    // Fails only if the handle has just been dropped.
                    let _ = listener.send(message.feedback);
                }
            }
            Err(error) => tracing::warn!("{name}: feedback ignored: {error}"),
        }
    }
}

/// A random goal identity.
fn random_goal_id() -> GoalId {
    let mut id = [0; 16];
    id[..8].copy_from_slice(&random_bytes(1));
    id[8..].copy_from_slice(&random_bytes(2));
    id
}

/// Random bytes: the standard library seeds its hashers from the system's randomness.
fn random_bytes(salt: u64) -> [u8; 8] {
    let mut hasher = RandomState::new().build_hasher();
    hasher.write_u64(salt);
    hasher.write_i64(crate::Stamp::wall().nanos());
    hasher.finish().to_le_bytes()
}
