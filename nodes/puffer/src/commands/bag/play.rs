//! `puffer bag play`.

use super::command_node::{interruption_error, with_node};
use super::played_scans::{PlayedScans, ScanPacing};
use super::topics;
use crate::exit_status::usage_error;
use anyhow::{Result, bail};
use clap::Args;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_ros::bag::{BagMessage, BagReader, BagTopic, Player};
use puffer_ros::{Interface, NoParams, Node, Stop};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Duration;

/// How long readers may take to appear.
const READERS_DEADLINE: Duration = Duration::from_secs(15);
/// How long the last messages may take to arrive.
const FLUSH_DEADLINE: Duration = Duration::from_secs(60);

/// Publishes what a bag holds on the domain ROS_DOMAIN_ID: without --topics only what came from
/// robot and sensor, so that running nodes do with it what they did before.
#[derive(Args)]
pub struct PlayCommand {
    /// An .mcap file, or a rosbag2 folder of them
    #[arg(value_name = "BAG")]
    path: PathBuf,
    /// Seconds of the bag in one second; 0: as fast as they go out
    #[arg(long, default_value_t = 1.0)]
    rate: f64,
    /// Play these topics instead
    #[arg(long, value_name = "TOPIC", num_args = 1..)]
    topics: Vec<String>,
    /// When all is played, have the modeller make the mesh, and print its path
    #[arg(long)]
    finish: bool,
}

impl PlayCommand {
    pub(super) fn run(&self) -> Result<()> {
        if !(self.rate >= 0.0 && self.rate.is_finite()) {
            return Err(usage_error(format!("--rate {}: must be 0 or more", self.rate)));
        }
        let bag = BagReader::open(&self.path)?;
        let chosen = self.chosen(&bag.info().topics)?;
        with_node("bag_player", &[], false, async |node, stop| {
            self.play(&node, &bag, &chosen, &stop).await
        })
    }

    /// The topics to play.
    fn chosen(&self, topics: &[BagTopic]) -> Result<Vec<BagTopic>> {
        if self.topics.is_empty() {
            let inputs: Vec<BagTopic> =
                topics.iter().filter(|t| topics::is_input(t) && t.count > 0).cloned().collect();
            if inputs.is_empty() {
                bail!("{} holds nothing of a robot or sensor: name --topics", self.path.display());
            }
            return Ok(inputs);
        }
        self.topics.iter().map(|name| topic_by_name(topics, name)).collect()
    }

    async fn play(
        &self,
        node: &Node<NoParams>,
        bag: &BagReader,
        chosen: &[BagTopic],
        stop: &Stop,
    ) -> Result<()> {
        let scans = if self.finish { Some(PlayedScans::new(node)?) } else { None };
        let routes: Vec<_> = chosen.iter().map(topics::playback_route).collect();
        let player = Player::new(node, &routes)?;
        let ready = stop.or(player.wait_for_readers(READERS_DEADLINE)).await;
        if let Err(error) = ready.ok_or_else(interruption_error)? {
            if self.finish {
                return Err(error.context("the nodes must run before the bag is played"));
            }
            // A bag may hold more than anybody asks for.
            eprintln!("puffer: {error:#}; playing all the same");
        }
        let names: Vec<&str> = chosen.iter().map(|t| &*t.name).collect();
        let rate = Some(self.rate).filter(|rate| *rate > 0.0);
        let clouds: BTreeSet<&str> = chosen
            .iter()
            .filter(|t| *t.type_name == *PointCloud2::TYPE_NAME)
            .map(|t| &*t.name)
            .collect();
        let mut pacing = ScanPacing::default();
        let played =
            player.play(bag.messages(&names)?, rate, async |message: &BagMessage| match &scans {
                Some(scans) => pacing.wait_for_turn(message, &clouds, scans).await,
                None => Ok(()),
            });
        let count = stop.or(played).await;
        let count = count.ok_or_else(interruption_error)??;
        stop.or(player.flush(FLUSH_DEADLINE)).await.ok_or_else(interruption_error)??;
        eprintln!("{count} messages of {} topics on DDS domain {}", names.len(), node.domain());
        if let Some(scans) = scans {
            let mesh =
                stop.or(scans.make_mesh(pacing.clouds)).await.ok_or_else(interruption_error)??;
            println!("{mesh}");
        }
        Ok(())
    }
}

/// The topic of a bag that the user names.
fn topic_by_name(topics: &[BagTopic], name: &str) -> Result<BagTopic> {
    topics.iter().find(|topic| &*topic.name == name).cloned().ok_or_else(|| {
        let known = topics.iter().map(|topic| &*topic.name).collect::<Vec<_>>().join(", ");
        usage_error(format!("--topics {name}: is not in the bag; there are {known}"))
    })
}
