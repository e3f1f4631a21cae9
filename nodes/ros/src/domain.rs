//! DDS domains, and which of them are free on this machine.

use anyhow::{Result, bail};
use std::net::UdpSocket;
use std::sync::atomic::{AtomicU16, Ordering};

/// The domains that [`find_free`] tries; people use the low ones.
const CANDIDATE_DOMAINS: std::ops::RangeInclusive<u16> = 101..=230;
/// Number of participants of a free domain whose ports must be free.
const CHECKED_PARTICIPANTS: u16 = 12;
/// Largest number of participants of a domain on one machine: a domain has 250 ports.
const MAX_PARTICIPANTS: u16 = 120;

/// The first port of domain 0 (RTPS 2.5, 9.6.2.3: PB).
const PORT_BASE: u16 = 7400;
/// Number of ports of a domain (RTPS 2.5, 9.6.2.3: DG).
const PORTS_PER_DOMAIN: u16 = 250;
/// Step between consecutive domains that [`find_free`] tries: processes that start at neighbouring
/// domains do not follow each other.
const DOMAIN_STEP: u16 = 7;

/// The ports of a domain (RTPS 2.5, 9.6.2.3): discovery and data by multicast, then by unicast for
/// each participant.
fn ports(domain: u16) -> impl Iterator<Item = u16> {
    let base = PORT_BASE + PORTS_PER_DOMAIN * domain;
    let unicast =
        (0..CHECKED_PARTICIPANTS).flat_map(move |p| [base + 10 + 2 * p, base + 11 + 2 * p]);
    [base, base + 1].into_iter().chain(unicast)
}

/// Whether no socket on this machine is bound to a port of the domain.
pub fn is_free(domain: u16) -> bool {
    ports(domain).all(is_port_free)
}

/// How many more participants of this machine have room on the domain, and how many it has room for
/// in all.
pub fn free_participants(domain: u16) -> (usize, usize) {
    let base = PORT_BASE + PORTS_PER_DOMAIN * domain;
    // Ports beyond those of the last participant belong to the next domain.
    let ports = (0..MAX_PARTICIPANTS).filter_map(|p| base.checked_add(11 + 2 * p));
    let ports: Vec<u16> = ports.collect();
    let free = ports.iter().filter(|port| is_port_free(**port - 1) && is_port_free(**port));
    (free.count(), ports.len())
}

/// A domain whose ports are free, for a run or a test of its own; each call in this process returns
/// another one. Which domain is tried first depends on the process, so that two processes that
/// start at once do not collide.
///
/// # Errors
/// If all domains are in use.
pub fn find_free() -> Result<u16> {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    let count = CANDIDATE_DOMAINS.end() - CANDIDATE_DOMAINS.start() + 1;
    let first = (std::process::id() % u32::from(count)) as u16;
    for _ in 0..count {
        let step = NEXT.fetch_add(1, Ordering::Relaxed) % count;
        let domain = CANDIDATE_DOMAINS.start() + (first + DOMAIN_STEP * step) % count;
        if is_free(domain) {
            return Ok(domain);
        }
    }
    bail!("no DDS domain from {} to {} is free", CANDIDATE_DOMAINS.start(), CANDIDATE_DOMAINS.end())
}

fn is_port_free(port: u16) -> bool {
    UdpSocket::bind(("0.0.0.0", port)).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_domain_in_use_is_not_free() {
        let domain = find_free().unwrap();
        assert_ne!(find_free().unwrap(), domain);
        let socket = UdpSocket::bind(("0.0.0.0", 7400 + 250 * domain + 11)).unwrap();
        assert!(!is_free(domain));
        drop(socket);
        assert!(is_free(domain));
        assert!(ports(230).all(|port| port > 0) && 7400 + 250 * 230 < u16::MAX as u32 as i32);
    }
}
