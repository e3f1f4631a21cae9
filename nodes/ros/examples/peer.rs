//! A node that other DDS implementations can be tried against: it echoes `~/in` on `~/out`, tells a
//! latched word on `~/word`, answers `~/switch`, and with the parameter `peer.ask` calls `/switch`
//! until it is answered.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use puffer_core::param_groups;
use puffer_msgs::std_msgs::msg::Header;
use puffer_msgs::std_srvs::srv::{SetBool, SetBoolRequest, SetBoolResponse};
use puffer_ros::{Node, QosProfile, RosArgs, Stop};
use std::process::ExitCode;
use std::time::Duration;

puffer_core::params! {
    /// What the example does.
    pub struct Peer("peer") {
        /// Whether the service /switch is called at the start.
        ask: bool = false;
        /// How long its answer is waited for.
        patience: f64 = 30.0, in [0.1, 3600.0], unit "s";
    }
}

param_groups! {
    /// Parameters of the example.
    pub struct Params {
        /// What it does.
        peer: Peer,
    }
}

async fn run(args: RosArgs, stop: Stop) -> anyhow::Result<()> {
    let node = Node::<Params>::start("peer", args, stop).await?;
    let word = node.publisher::<Header>("~/word", QosProfile::Latched)?;
    word.publish(&Header { stamp: node.now().into(), frame_id: "latched".to_owned() })?;
    node.serve::<SetBool, _, _>("~/switch", |request| async move {
        SetBoolResponse { success: request.data, message: "switched".to_owned() }
    })?;
    let echo = node.publisher::<Header>("~/out", QosProfile::Standard)?;
    let mut heard = node.subscribe::<Header>("~/in", QosProfile::Standard)?;
    if node.params().peer.ask {
        let patience = Duration::from_secs_f64(node.params().peer.patience);
        let client = node.client::<SetBool>("/switch")?;
        let answer = client.call(&SetBoolRequest { data: true }, patience).await?;
        println!("answer: {} {}", answer.success, answer.message);
    }
    while let Some(message) = heard.next().await {
        echo.publish(&Header { frame_id: format!("echo {}", message.frame_id), ..message })?;
    }
    Ok(())
}

fn main() -> ExitCode {
    puffer_ros::main(run)
}
