//! What the tests share: a free domain, nodes on it, and a generous deadline.
// Each test program uses its own part of it.
#![allow(dead_code)]

use puffer_core::params::Parameters;
use puffer_ros::{Node, RosArgs, Stop};
use std::time::Duration;

/// For everything that must come: long enough for a loaded machine.
pub const SOON: Duration = Duration::from_secs(60);

/// A domain that nobody uses, another one for each call.
pub fn free_domain() -> u16 {
    puffer_ros::domain::find_free().unwrap()
}

pub async fn node<P: Parameters>(name: &str, domain: u16) -> Node<P> {
    node_with(name, RosArgs::default().with_domain(domain)).await
}

pub async fn node_with<P: Parameters>(name: &str, args: RosArgs) -> Node<P> {
    Node::start(name, args, Stop::new()).await.unwrap()
}

/// Asks again and again until the answer is the one wanted.
pub async fn eventually(what: &str, mut holds: impl FnMut() -> bool) {
    let until = tokio::time::Instant::now() + SOON;
    while !holds() {
        assert!(tokio::time::Instant::now() < until, "never: {what}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}
