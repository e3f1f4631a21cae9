//! DDS domains, and which of them nobody uses.

use anyhow::{Result, bail};
use std::net::UdpSocket;
use std::sync::atomic::{AtomicU16, Ordering};

/// Domains that are tried; low ones are people's own.
const DOMAINS: std::ops::RangeInclusive<u16> = 101..=230;
/// Participants of a domain whose ports must be free.
const PARTICIPANTS: u16 = 12;
/// Participants of a domain on one machine at most, 250 ports being a domain's.
const MOST_PARTICIPANTS: u16 = 120;

/// Ports of a domain (RTPS 2.5, 9.6.2.3): discovery and data by multicast, and by unicast for each participant.
fn ports(domain: u16) -> impl Iterator<Item = u16> {
    let base = 7400 + 250 * domain;
    let of_participant =
        (0..PARTICIPANTS).flat_map(move |p| [base + 10 + 2 * p, base + 11 + 2 * p]);
    [base, base + 1].into_iter().chain(of_participant)
}

/// Whether no socket on this machine is bound to a port of the domain.
pub fn is_free(domain: u16) -> bool {
    ports(domain).all(|port| UdpSocket::bind(("0.0.0.0", port)).is_ok())
}

/// How many more participants of this machine have room on the domain, and how many it has room for at all.
pub fn free_participants(domain: u16) -> (usize, usize) {
    let base = 7400 + 250 * domain;
    // Beyond, a participant's ports are those of the next domain.
    let ports = (0..MOST_PARTICIPANTS).filter_map(|p| base.checked_add(11 + 2 * p));
    let is_free = |port: &u16| {
        [port - 1, *port].iter().all(|port| UdpSocket::bind(("0.0.0.0", *port)).is_ok())
    };
    let ports: Vec<u16> = ports.collect();
    (ports.iter().filter(|port| is_free(port)).count(), ports.len())
}

/// A free domain, for a run or a test of its own: another one at each call in this process. Which one is tried first
/// depends on the process, so that two that begin at once do not meet.
///
/// # Errors
/// All are in use.
pub fn free() -> Result<u16> {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    let count = DOMAINS.end() - DOMAINS.start() + 1;
    let first = (std::process::id() % u32::from(count)) as u16;
    let next = |_| {
        let step = NEXT.fetch_add(1, Ordering::Relaxed) % count;
        DOMAINS.start() + (first + 7 * step) % count
    };
    match (0..count).map(next).find(|domain| is_free(*domain)) {
        Some(domain) => Ok(domain),
        None => bail!("no DDS domain from {} to {} is free", DOMAINS.start(), DOMAINS.end()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_domain_in_use_is_not_free() {
        let domain = free().unwrap();
        assert_ne!(free().unwrap(), domain);
        let socket = UdpSocket::bind(("0.0.0.0", 7400 + 250 * domain + 11)).unwrap();
        assert!(!is_free(domain));
        drop(socket);
        assert!(is_free(domain));
        assert!(ports(230).all(|port| port > 0) && 7400 + 250 * 230 < u16::MAX as u32 as i32);
    }
}
