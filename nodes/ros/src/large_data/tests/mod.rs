//! Tests of the protocol as a whole: a sender and receivers over a simulated link.

mod link_tests;
mod retention_tests;
mod simulated_link;
