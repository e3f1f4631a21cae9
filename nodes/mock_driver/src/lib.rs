//! Simulated robot and sensor behind the topics of real ones.
