//! Requests and answers of every length arrive, whatever interfaces the hosts have: they decide, by
//! length, whether DDS sends a sample whole or in fragments.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use common::{SOON, free_domain, node_with};
use puffer_msgs::srv::{LoadObject, LoadObjectRequest, LoadObjectResponse};
use puffer_ros::{Client, NoParams, Node, RosArgs, ServiceMapping};
use std::process::{Command, Stdio};
use std::time::Duration;

const MAPPINGS: [ServiceMapping; 2] = [ServiceMapping::Enhanced, ServiceMapping::Cyclone];
/// Longest text that is tried with all shorter ones: on Ethernet, those of half its length leave in
/// fragments already.
const MAX_DENSE_LENGTH: usize = 3000;
/// Longer texts: with all remainders by 4, about the largest datagram of 65,507 bytes, and beyond.
const LONG_LENGTHS: [usize; 20] = [
    3_001, 4_093, 5_678, 8_191, 12_346, 16_381, 24_002, 32_767, 40_000, 48_001, 56_789, 60_002,
    65_270, 65_350, 65_391, 65_396, 65_422, 65_501, 66_667, 70_000,
];
/// Domains, one a convention, on hosts of the test's own, where nobody else is.
const OWN_DOMAINS: [u16; 2] = [42, 43];
/// How long another host answers at most, should nobody end it.
const MAX_HOST_LIFE: Duration = Duration::from_secs(600);

/// Makes this network namespace a host with loopback only.
const LOOPBACK: &str = "ip link set lo up";
/// Adds an interface as of an Ethernet of 1,500 bytes.
const ETHERNET: &str = "ip link set lo up
ip link add eth0 type veth peer name eth1
ip link set eth1 up
ip address add 10.211.0.1/24 dev eth0
ip link set eth0 up";
/// Puts another host, which answers, on the other end of a cable.
const CABLE: &str = r#"ip link set lo up
ip link add eth0 type veth peer name eth1
unshare --net sh -ec '
    ip link set lo up
    until ip address add 10.211.0.2/24 dev eth1 2>/dev/null; do sleep 0.05; done
    ip link set eth1 up
    exec "$0" --exact another_host_answers --ignored' "$0" >&2 &
trap "kill $!" EXIT
while ip link show eth1 >/dev/null 2>&1; do ip link set eth1 netns $!; sleep 0.05; done
ip address add 10.211.0.1/24 dev eth0
ip link set eth0 up"#;

/// A node that answers each text with itself.
async fn answerer(domain: u16, mapping: ServiceMapping) -> Node<NoParams> {
    let args = RosArgs::default().with_domain(domain).with_mapping(mapping);
    let node = node_with::<NoParams>("answerer", args).await;
    node.serve::<LoadObject, _, _>("echo", |request: LoadObjectRequest| async move {
        LoadObjectResponse { success: true, error_code: 7, message: request.object }
    })
    .unwrap();
    node
}

/// Asks with texts that look, at every eighth byte, like the mark in front of an identity.
async fn ask_every_length(domain: u16, mapping: ServiceMapping) {
    let args = RosArgs::default().with_domain(domain).with_mapping(mapping);
    let asker = node_with::<NoParams>("asker", args).await;
    let client: Client<LoadObject> = asker.client("echo").unwrap();
    let longest: String = "\0related".chars().cycle().take(LONG_LENGTHS[19]).collect();
    for length in (0..=MAX_DENSE_LENGTH).chain(LONG_LENGTHS) {
        let request = LoadObjectRequest { object: longest[..length].to_owned() };
        let answer = client.call(&request, SOON).await;
        let answer = answer.unwrap_or_else(|error| panic!("{mapping:?}, {length}: {error}"));
        assert!(answer.success && answer.error_code == 7, "{mapping:?}, {length}");
        assert!(answer.message == request.object, "{mapping:?}, {length}: another text");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_length_arrives() {
    for mapping in MAPPINGS {
        let domain = free_domain();
        let _answerer = answerer(domain, mapping).await;
        ask_every_length(domain, mapping).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "answers until it is killed; run on a host of its own by every_length_arrives_over_a_cable"]
async fn another_host_answers() {
    let [first, second] = [0, 1].map(|at| answerer(OWN_DOMAINS[at], MAPPINGS[at]));
    let _answerers = (first.await, second.await);
    tokio::time::sleep(MAX_HOST_LIFE).await;
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs another host; run by every_length_arrives_over_a_cable"]
async fn another_host_is_asked() {
    for (domain, mapping) in OWN_DOMAINS.into_iter().zip(MAPPINGS) {
        ask_every_length(domain, mapping).await;
    }
}

/// A shell script in a network namespace of its own.
fn unshare(script: &str) -> Command {
    let mut command = Command::new("unshare");
    command.args(["--map-root-user", "--net", "sh", "-ec", script]);
    command.stdin(Stdio::null());
    command
}

/// Runs a test of this file in a network namespace of its own, which a shell script has set up.
fn on_a_host(interfaces: &str, test: &[&str]) {
    let possible =
        unshare("ip link set lo up && ip link add eth0 type veth peer name eth1").output();
    match possible {
        Ok(output) if output.status.success() => {}
        refused => {
            println!(
                "SKIPPED: a host of its own needs unshare, ip and the right to use them: {refused:?}"
            );
            return;
        }
    }
    let script = format!("{interfaces}\n\"$0\" --exact \"$@\"");
    let this = std::env::current_exe().unwrap();
    let output = unshare(&script).arg(this).args(test).output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    assert!(output.status.success() && said.contains("1 passed"), "{said}");
}

#[test]
fn every_length_arrives_on_a_host_with_loopback_only() {
    on_a_host(LOOPBACK, &["every_length_arrives"]);
}

#[test]
fn every_length_arrives_on_a_host_with_ethernet() {
    on_a_host(ETHERNET, &["every_length_arrives"]);
}

#[test]
fn every_length_arrives_over_a_cable() {
    on_a_host(CABLE, &["another_host_is_asked", "--ignored"]);
}
