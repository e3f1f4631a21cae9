//! All ROS glue.

pub mod bulk;
