//! `puffer bag record`.

use super::{command_node::with_node, topics};
use crate::exit_status::usage_error;
use anyhow::Result;
use clap::Args;
use puffer_ros::bag::{BagWriter, Recording, TopicRoute};
use std::path::PathBuf;

/// Records topics of the domain ROS_DOMAIN_ID until Ctrl-C.
#[derive(Args)]
pub struct RecordCommand {
    /// Bag to write, .mcap; must not exist
    #[arg(short, long, value_name = "BAG")]
    output: PathBuf,
    /// Topics with their types, such as /points:sensor_msgs/msg/PointCloud2 [default: all of the
    /// suite]
    #[arg(value_name = "TOPIC:TYPE")]
    topics: Vec<String>,
    /// Stamp messages with /clock instead of this machine's time
    #[arg(long)]
    use_sim_time: bool,
}

impl RecordCommand {
    pub(super) fn run(&self) -> Result<()> {
        if self.output.extension().is_none_or(|e| e != "mcap") {
            return Err(usage_error(format!(
                "-o {}: the name must end in .mcap",
                self.output.display()
            )));
        }
        let topics = self.routes()?;
        let bag = BagWriter::create(&self.output)?;
        let simulated: &[&str] = &["--ros-args", "-p", "use_sim_time:=true"];
        let arguments = if self.use_sim_time { simulated } else { &[] };
        let count = with_node("bag_recorder", arguments, true, async |node, _| {
            let recording = Recording::start(&node, &topics, bag)?;
            eprintln!(
                "recording {} topics of DDS domain {} until Ctrl-C",
                topics.len(),
                node.domain()
            );
            recording.finished().await
        })?;
        println!("{count} messages in {}", self.output.display());
        Ok(())
    }

    fn routes(&self) -> Result<Vec<TopicRoute>> {
        if self.topics.is_empty() {
            return Ok(topics::suite_routes());
        }
        let parsed = self.topics.iter().map(|text| match text.split_once(':') {
            Some((name, type_name)) if !name.is_empty() && !type_name.is_empty() => {
                Ok(topics::route_of_name(name, type_name))
            }
            _ => Err(usage_error(format!(
                "{text}: expected TOPIC:TYPE, such as /points:sensor_msgs/msg/PointCloud2"
            ))),
        });
        parsed.collect()
    }
}
