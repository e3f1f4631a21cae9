//! Transforms between frames over time, as tf2 of ROS 2 keeps them.

mod broadcaster;
mod buffer;
mod frame_link;
mod frame_tree;
mod listener;
#[cfg(test)]
mod tests;
mod tf_error;
mod transform;

pub use broadcaster::TfBroadcaster;
pub use buffer::TfBuffer;
pub(crate) use listener::subscribe;
pub use tf_error::TfError;
pub use transform::Transform;
