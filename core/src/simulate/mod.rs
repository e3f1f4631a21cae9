//! Simulated objects, sensors and robots.

pub mod objects;
