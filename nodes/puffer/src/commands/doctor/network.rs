//! Checks of sockets, domain and discovery.

use super::{Check, Finding};
use anyhow::{Context, Result};
use puffer_msgs::std_srvs::srv::{Trigger, TriggerRequest, TriggerResponse};
use puffer_shell::bulk::{receive_buffer, receive_buffer_limit};
use puffer_shell::{NoParams, Node, RosArgs, Stop, domain};
use std::net::{Ipv4Addr, UdpSocket};
use std::time::{Duration, Instant};

/// What tiles between nodes are made for: `net.core.rmem_max` of stock Debian and Ubuntu, bytes.
const TILES: usize = 212_992;
/// Carries the whole clouds of one laser scan to RViz and rosbag2, bytes.
const WHOLE_CLOUDS: usize = 32 << 20;
/// Nodes of puffer on one domain.
const NODES: usize = 8;
/// Where DDS participants find each other (RTPS 2.5, 9.6.2.4).
const DISCOVERY_GROUP: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);
/// How long a datagram or an answer may take.
const DEADLINE: Duration = Duration::from_secs(10);

pub(super) fn checks() -> Vec<Check> {
    let args = RosArgs::parse(std::iter::empty());
    let domain = args.as_ref().map_or(0, RosArgs::domain);
    vec![environment(&args), ports(domain), private_domain(), buffers(), multicast(), discovery()]
}

fn environment(args: &Result<RosArgs>) -> Check {
    let found = match args {
        Ok(args) => format!("DDS domain {}", args.domain()),
        Err(error) => format!("{error:#}"),
    };
    let mend =
        "export ROS_DOMAIN_ID=0 RMW_IMPLEMENTATION=rmw_fastrtps_cpp, as the robot's other nodes";
    Check::new("ROS environment", args.is_ok(), found, mend)
}

fn ports(domain: u16) -> Check {
    let (free, all) = domain::free_participants(domain);
    let found = format!("domain {domain} has room for {free} of {all} participants");
    let mend = "export ROS_DOMAIN_ID to another domain, or end programs on this one (ss -lunp)";
    Check::new("free ports", free >= NODES, found, mend)
}

fn private_domain() -> Check {
    let mend = "end programs that hold UDP ports from 32650 on (ss -lunp)";
    match domain::free() {
        Ok(domain) => Check::new("private domain", true, format!("{domain} is free"), mend),
        Err(error) => Check::new("private domain", false, error.to_string(), mend),
    }
}

fn buffers() -> Check {
    let granted = receive_buffer(WHOLE_CLOUDS).map_or(0, |bytes| bytes / 2);
    let limit = receive_buffer_limit().unwrap_or(granted);
    let finding = match limit {
        0..TILES => Finding::Bad,
        TILES..WHOLE_CLOUDS => Finding::Advice,
        _ => Finding::Good,
    };
    let found = match finding {
        Finding::Bad => format!("net.core.rmem_max is {limit}, too little for clouds and meshes"),
        Finding::Advice => format!(
            "net.core.rmem_max is {limit}: puffer's nodes reach each other; RViz, rosbag2 and scripts get whole \
             messages up to {:.1} MB",
            limit as f64 / 1e6
        ),
        Finding::Good => format!("net.core.rmem_max is {limit}"),
    };
    let mend =
        format!("sudo sysctl -w net.core.rmem_max={WHOLE_CLOUDS}, on every machine of the robot");
    Check { name: "socket buffers", finding, found, mend }
}

/// Without multicast on the loopback interface, processes of this machine find each other only while another
/// network is up.
fn multicast() -> Check {
    let outcome = multicast_on_loopback();
    let found = match &outcome {
        Ok(()) => "reaches this machine over the loopback interface".to_owned(),
        Err(error) => format!("none on the loopback interface: {error:#}"),
    };
    let finding = if outcome.is_ok() { Finding::Good } else { Finding::Advice };
    let mend =
        "sudo ip link set lo multicast on && sudo ip route add 239.0.0.0/8 dev lo".to_owned();
    Check { name: "multicast", finding, found, mend }
}

fn multicast_on_loopback() -> Result<()> {
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
fn discovery() -> Check {
    let mend = "see the checks above; a firewall must let UDP between this machine's own addresses pass \
                (sudo iptables -L -n)";
    match ask_a_node() {
        Ok(time) => {
            let found = format!("a node is found and answers in {:.2} s", time.as_secs_f64());
            Check::new("DDS", true, found, mend)
        }
        Err(error) => Check::new("DDS", false, format!("{error:#}"), mend),
    }
}

fn ask_a_node() -> Result<Duration> {
    let args = RosArgs::default().with_domain(domain::free()?);
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let outcome = runtime.block_on(async {
        let answers: Node<NoParams> = Node::start("doctor", args.clone(), Stop::new()).await?;
        let asks: Node<NoParams> = Node::start("patient", args, Stop::new()).await?;
        let since = Instant::now();
        answers.serve::<Trigger, _, _>("~/ask", |_| async {
            TriggerResponse { success: true, message: String::new() }
        })?;
        asks.client::<Trigger>("doctor/ask")?.call(&TriggerRequest::default(), DEADLINE).await?;
        Ok(since.elapsed())
    });
    runtime.shutdown_timeout(Duration::from_secs(1));
    outcome
}
