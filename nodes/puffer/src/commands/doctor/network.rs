//! Checks of sockets, domain and discovery.

use super::check::{Check, CheckOutcome};
use anyhow::{Context, Result};
use puffer_msgs::std_srvs::srv::{Trigger, TriggerRequest, TriggerResponse};
use puffer_ros::large_data::{receive_buffer, receive_buffer_limit};
use puffer_ros::{NoParams, Node, RosArgs, Stop, domain};
use std::net::{Ipv4Addr, UdpSocket};
use std::time::{Duration, Instant};

/// What tiles between nodes are made for: `net.core.rmem_max` of stock Debian and Ubuntu, bytes.
const MIN_TILE_BUFFER: usize = 212_992;
/// Carries the whole clouds of one laser scan to RViz and rosbag2, bytes.
const WHOLE_CLOUD_BUFFER: usize = 32 << 20;
/// Nodes of puffer on one domain.
const NODE_COUNT: usize = 8;
/// Where DDS participants find each other (RTPS 2.5, 9.6.2.4).
const DISCOVERY_GROUP: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);
/// How long a datagram or an answer may take.
const ANSWER_DEADLINE: Duration = Duration::from_secs(10);

pub(super) fn checks() -> Vec<Check> {
    let args = RosArgs::parse(std::iter::empty());
    let domain = args.as_ref().map_or(0, RosArgs::domain);
    vec![
        check_environment(&args),
        check_ports(domain),
        check_private_domain(),
        check_socket_buffers(),
        check_multicast(),
        check_discovery(),
    ]
}

fn check_environment(args: &Result<RosArgs>) -> Check {
    let found = match args {
        Ok(args) => format!("DDS domain {}", args.domain()),
        Err(error) => format!("{error:#}"),
    };
    let mend =
        "export ROS_DOMAIN_ID=0 RMW_IMPLEMENTATION=rmw_fastrtps_cpp, as the robot's other nodes";
    Check::new("ROS environment", args.is_ok(), found, mend)
}

fn check_ports(domain: u16) -> Check {
    let (free, all) = domain::free_participants(domain);
    let found = format!("domain {domain} has room for {free} of {all} participants");
    let mend = "export ROS_DOMAIN_ID to another domain, or end programs on this one (ss -lunp)";
    Check::new("free ports", free >= NODE_COUNT, found, mend)
}

fn check_private_domain() -> Check {
    let mend = "end programs that hold UDP ports from 32650 on (ss -lunp)";
    match domain::find_free() {
        Ok(domain) => Check::new("private domain", true, format!("{domain} is free"), mend),
        Err(error) => Check::new("private domain", false, error.to_string(), mend),
    }
}

fn check_socket_buffers() -> Check {
    let granted = receive_buffer(WHOLE_CLOUD_BUFFER).map_or(0, |bytes| bytes / 2);
    let limit = receive_buffer_limit().unwrap_or(granted);
    let finding = match limit {
        0..MIN_TILE_BUFFER => CheckOutcome::Bad,
        MIN_TILE_BUFFER..WHOLE_CLOUD_BUFFER => CheckOutcome::Advice,
        _ => CheckOutcome::Good,
    };
    let found = match finding {
        CheckOutcome::Bad => {
            format!("net.core.rmem_max is {limit}, too little for clouds and meshes")
        }
        CheckOutcome::Advice => format!(
            "net.core.rmem_max is {limit}: puffer's nodes reach each other; RViz, rosbag2 and scripts get whole \
             messages up to {:.1} MB",
            limit as f64 / 1e6
        ),
        CheckOutcome::Good => format!("net.core.rmem_max is {limit}"),
    };
    let mend = format!(
        "sudo sysctl -w net.core.rmem_max={WHOLE_CLOUD_BUFFER}, on every machine of the robot"
    );
    Check { name: "socket buffers", finding, found, mend }
}

/// Without multicast on the loopback interface, processes of this machine find each other only
/// while another network is up.
fn check_multicast() -> Check {
    let outcome = send_over_loopback();
    let found = match &outcome {
        Ok(()) => "reaches this machine over the loopback interface".to_owned(),
        Err(error) => format!("none on the loopback interface: {error:#}"),
    };
    let finding = if outcome.is_ok() { CheckOutcome::Good } else { CheckOutcome::Advice };
    let mend =
        "sudo ip link set lo multicast on && sudo ip route add 239.0.0.0/8 dev lo".to_owned();
    Check { name: "multicast", finding, found, mend }
}

fn send_over_loopback() -> Result<()> {
    let listener = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
    listener.join_multicast_v4(&DISCOVERY_GROUP, &Ipv4Addr::LOCALHOST).context("cannot join")?;
    listener.set_read_timeout(Some(Duration::from_secs(1)))?;
    // Bound to it, the sender sends over the loopback interface.
    let sender = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    let said = std::process::id().to_ne_bytes();
    sender
        .send_to(&said, (DISCOVERY_GROUP, listener.local_addr()?.port()))
        .context("cannot send")?;
    let mut heard = [0; 16];
    let (count, _) = listener.recv_from(&mut heard).context("nothing comes")?;
    anyhow::ensure!(heard[..count] == said, "something else comes");
    Ok(())
}

/// Two nodes on a private domain: one asks, the other answers.
fn check_discovery() -> Check {
    let mend = "see the checks above; a firewall must let UDP between this machine's own addresses pass \
                (sudo iptables -L -n)";
    match call_between_nodes() {
        Ok(time) => {
            let found = format!("a node is found and answers in {:.2} s", time.as_secs_f64());
            Check::new("DDS", true, found, mend)
        }
        Err(error) => Check::new("DDS", false, format!("{error:#}"), mend),
    }
}

fn call_between_nodes() -> Result<Duration> {
    let args = RosArgs::default().with_domain(domain::find_free()?);
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let outcome = runtime.block_on(async {
        let answers: Node<NoParams> = Node::start("doctor", args.clone(), Stop::new()).await?;
        let asks: Node<NoParams> = Node::start("patient", args, Stop::new()).await?;
        let since = Instant::now();
        answers.serve::<Trigger, _, _>("~/ask", |_| async {
            TriggerResponse { success: true, message: String::new() }
        })?;
        asks.client::<Trigger>("doctor/ask")?
            .call(&TriggerRequest::default(), ANSWER_DEADLINE)
            .await?;
        Ok(since.elapsed())
    });
    runtime.shutdown_timeout(Duration::from_secs(1));
    outcome
}
