//! Simulated objects, sensors and robots.
