//! Robot model: kinematics, reachability, collisions and paths.
