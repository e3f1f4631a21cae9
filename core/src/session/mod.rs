//! The modelling loop as a pure state machine.
