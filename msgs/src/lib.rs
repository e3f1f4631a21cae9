//! ROS 2 interfaces.
