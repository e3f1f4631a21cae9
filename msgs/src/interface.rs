//! What the generated types have in common.

use crate::builtin_interfaces::msg::Time;
use crate::unique_identifier_msgs::msg::UUID;
use ros2_client::Message;
use serde::{Deserialize, Serialize};
use std::fmt::Debug;

/// A type that can be published and recorded: a message, or a part of a service or action.
pub trait Interface: Message + Clone + Debug + Default + PartialEq + Send + Sync + 'static {
    /// Package that defines it: `sensor_msgs`.
    const PACKAGE: &'static str;
    /// `msg`, `srv` or `action`.
    const KIND: &'static str;
    /// Name within the package: `PointCloud2`, `PlanView_Request`, `ModelObject_FeedbackMessage`.
    const NAME: &'static str;
    /// The three in a row: `sensor_msgs/msg/PointCloud2`.
    const TYPE_NAME: &'static str;
    /// Text of the .msg file, followed by those of all types inside, as bags store it (`ros2msg`).
    const DEFINITION: &'static str;
}

/// A service, or one of the services of an action.
pub trait Service: Send + Sync + 'static {
    /// Package that defines it.
    const PACKAGE: &'static str;
    /// `srv`, or `action` for the services of an action.
    const KIND: &'static str;
    /// Name within the package: `PlanView`, `ModelObject_SendGoal`.
    const NAME: &'static str;
    /// The three in a row: `puffer_msgs/srv/PlanView`.
    const TYPE_NAME: &'static str;
    /// What a client sends.
    type Request: Message + Clone + Debug + Default + PartialEq + Send + Sync + 'static;
    /// What a server answers.
    type Response: Message + Clone + Debug + Default + PartialEq + Send + Sync + 'static;
}

/// An action: its three parts, and the services that ROS 2 makes of them. Cancelling uses
/// `action_msgs/srv/CancelGoal`, the status topic `action_msgs/msg/GoalStatusArray`, the feedback topic
/// [`FeedbackMessage`].
pub trait Action: Send + Sync + 'static {
    /// Package that defines it.
    const PACKAGE: &'static str;
    /// Name within the package: `ModelObject`.
    const NAME: &'static str;
    /// `puffer_msgs/action/ModelObject`.
    const TYPE_NAME: &'static str;
    /// What is asked.
    type Goal: Interface;
    /// What comes out.
    type Result: Interface;
    /// What is told in between.
    type Feedback: Interface;
    /// The service that takes a goal in, `<action>/_action/send_goal`.
    type SendGoal: Service<Request = SendGoalRequest<Self::Goal>, Response = SendGoalResponse>;
    /// The service that gives the result, `<action>/_action/get_result`.
    type GetResult: Service<Request = GetResultRequest, Response = GetResultResponse<Self::Result>>;
}

/// Does something with each type of this crate; see [`visit_types`](crate::visit_types).
pub trait TypeVisitor {
    /// Is shown the type `T`.
    fn visit<T: Interface>(&mut self);
}

/// A goal and the number that its client gave it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SendGoalRequest<G> {
    /// Chosen by the client.
    pub goal_id: UUID,
    /// What is asked.
    pub goal: G,
}

/// Whether a goal was taken in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SendGoalResponse {
    /// False: refused.
    pub accepted: bool,
    /// When.
    pub stamp: Time,
}

/// Asks for a result; the answer comes when the goal has ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetResultRequest {
    /// That of the goal.
    pub goal_id: UUID,
}

/// How a goal ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetResultResponse<R> {
    /// One of the constants of `action_msgs/msg/GoalStatus`.
    pub status: i8,
    /// What came out.
    pub result: R,
}

/// Feedback of one goal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FeedbackMessage<F> {
    /// That of the goal.
    pub goal_id: UUID,
    /// What is told.
    pub feedback: F,
}

impl<G: Message> Message for SendGoalRequest<G> {}
impl Message for SendGoalResponse {}
impl Message for GetResultRequest {}
impl<R: Message> Message for GetResultResponse<R> {}
impl<F: Message> Message for FeedbackMessage<F> {}
