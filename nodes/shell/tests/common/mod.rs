//! What the tests share: a free domain, nodes on it, and a generous deadline.
// Each test program uses its own part of it.
#![allow(dead_code)]

use puffer_core::params::Parameters;
use puffer_shell::{Node, RosArgs, Stop};
use std::net::UdpSocket;
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::Duration;

/// For everything that must come: long enough for a loaded machine.
pub const SOON: Duration = Duration::from_secs(60);

/// A domain whose discovery port nobody has bound (RTPS 2.5, 9.6.2: 7400 + 250 d), different for each call.
pub fn free_domain() -> u16 {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    // Above 100 only the ports below the ephemeral range remain; the process number spreads test programs.
    let spread = (std::process::id() % 90) as u16;
    for _ in 0..90 {
        let domain = 5 + (spread + NEXT.fetch_add(1, Ordering::Relaxed)) % 90;
        let port = 7400 + 250 * domain;
        let free = |offset| UdpSocket::bind(("0.0.0.0", port + offset)).is_ok();
        if free(0) && free(10) && free(11) {
            return domain;
        }
    }
    panic!("no free DDS domain between 5 and 94");
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
