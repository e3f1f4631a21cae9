//! The traits of the generated types, and the messages that all actions share.

use crate::builtin_interfaces::msg::Time;
use crate::unique_identifier_msgs::msg::UUID;
use ros2_client::Message;
use serde::{Deserialize, Serialize};
use std::fmt::Debug;

/// A type that can be published and recorded: a message, or a part of a service or action.
pub trait Interface: Message + Clone + Debug + Default + PartialEq + Send + Sync + 'static {
    /// Package that defines the type: `sensor_msgs`.
    const PACKAGE: &'static str;
    /// `msg`, `srv` or `action`.
    const KIND: &'static str;
    /// Name within the package: `PointCloud2`, `PlanView_Request`, `ModelObject_FeedbackMessage`.
    const NAME: &'static str;
    /// Package, kind and name: `sensor_msgs/msg/PointCloud2`.
    const TYPE_NAME: &'static str;
    /// Text of the .msg file, followed by the texts of all types inside, as bags store it
    /// (`ros2msg`).
    const DEFINITION: &'static str;
}

/// A service, or one of the services of an action.
pub trait Service: Send + Sync + 'static {
    /// Package that defines the type.
    const PACKAGE: &'static str;
    /// `srv`, or `action` for the services of an action.
    const KIND: &'static str;
    /// Name within the package: `PlanView`, `ModelObject_SendGoal`.
    const NAME: &'static str;
    /// Package, kind and name: `puffer_msgs/srv/PlanView`.
    const TYPE_NAME: &'static str;
    /// The message that a client sends.
    type Request: Message + Clone + Debug + Default + PartialEq + Send + Sync + 'static;
    /// The message that a server answers.
    type Response: Message + Clone + Debug + Default + PartialEq + Send + Sync + 'static;
}

/// An action: its three parts, and the services that ROS 2 makes of them. Cancelling uses
/// `action_msgs/srv/CancelGoal`, the status topic `action_msgs/msg/GoalStatusArray`, the feedback
/// topic [`FeedbackMessage`].
pub trait Action: Send + Sync + 'static {
    /// Package that defines the type.
    const PACKAGE: &'static str;
    /// Name within the package: `ModelObject`.
    const NAME: &'static str;
    /// Package, kind and name: `puffer_msgs/action/ModelObject`.
    const TYPE_NAME: &'static str;
    /// What a client asks for.
    type Goal: Interface;
    /// What comes out at the end.
    type Result: Interface;
    /// What the server tells in between.
    type Feedback: Interface;
    /// The service that accepts goals, `<action>/_action/send_goal`.
    type SendGoal: Service<Request = SendGoalRequest<Self::Goal>, Response = SendGoalResponse>;
    /// The service that returns results, `<action>/_action/get_result`.
    type GetResult: Service<Request = GetResultRequest, Response = GetResultResponse<Self::Result>>;
}

/// Is shown each type of this crate by [`visit_types`](crate::visit_types): a way to choose a type
/// by its name at run time.
///
/// ```
/// use puffer_msgs::{Interface, TypeVisitor, visit_types};
///
/// struct DefaultSize(&'static str, Option<usize>);
///
/// impl TypeVisitor for DefaultSize {
///     fn visit<T: Interface>(&mut self) {
///         if T::TYPE_NAME == self.0 {
///             self.1 = puffer_msgs::cdr::to_bytes(&T::default()).ok().map(|bytes| bytes.len());
///         }
///     }
/// }
///
/// let mut size = DefaultSize("geometry_msgs/msg/Point", None);
/// visit_types(&mut size);
/// assert_eq!(size.1, Some(4 + 3 * 8));
/// ```
pub trait TypeVisitor {
    /// Takes the type `T`.
    fn visit<T: Interface>(&mut self);
}

/// A goal, and the identity that its client chose for it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SendGoalRequest<G> {
    /// The goal's identity, chosen by the client.
    pub goal_id: UUID,
    /// What the client asks for.
    pub goal: G,
}

/// Whether a goal was accepted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SendGoalResponse {
    /// Whether the goal was accepted.
    pub accepted: bool,
    /// When the server decided.
    pub stamp: Time,
}

/// A request for a result; the answer comes when the goal has ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetResultRequest {
    /// The goal's identity.
    pub goal_id: UUID,
}

/// How a goal ended, and its result.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetResultResponse<R> {
    /// One of the constants of `action_msgs/msg/GoalStatus`.
    pub status: i8,
    /// The result; empty if the goal is unknown.
    pub result: R,
}

/// Feedback, and the goal that it belongs to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FeedbackMessage<F> {
    /// The goal's identity.
    pub goal_id: UUID,
    /// What the server tells.
    pub feedback: F,
}

impl<G: Message> Message for SendGoalRequest<G> {}
impl Message for SendGoalResponse {}
impl Message for GetResultRequest {}
impl<R: Message> Message for GetResultResponse<R> {}
impl<F: Message> Message for FeedbackMessage<F> {}
