//! All ROS glue.
