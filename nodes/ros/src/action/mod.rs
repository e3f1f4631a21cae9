//! Actions: three services and two topics (<https://design.ros2.org/articles/actions.html>). A
//! server keeps results, so that whoever asks for one gets it, also twice, and nothing waits for a
//! client to ask.

mod action_context;
mod client;
mod goal_table;
mod server;
mod server_goal;

pub(crate) use action_context::ActionContext;
pub use client::{ActionClient, GoalHandle};
pub(crate) use server::serve;
pub use server_goal::{Goal, GoalProgress, Outcome};
