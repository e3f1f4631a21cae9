//! Registered scans and the robot to the next best view.
