//! Runs the modelling loop.
