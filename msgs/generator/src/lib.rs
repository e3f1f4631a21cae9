//! Rust types from ROS 2 interface files.
