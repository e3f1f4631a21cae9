//! `puffer bag play`.

use super::node::{interrupted, with_node};
use super::topics;
use crate::failure::usage;
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::std_srvs::srv::{Trigger, TriggerRequest};
use puffer_shell::bag::{BagReader, BagTopic, Player};
use puffer_shell::bulk::{BulkSubscription, Delivery};
use puffer_shell::{Client, Interface, NoParams, Node, Stop};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Duration;

/// How long readers may take to appear.
const READERS_DEADLINE: Duration = Duration::from_secs(15);
/// How long the last messages may take to arrive.
const FLUSH_DEADLINE: Duration = Duration::from_secs(60);
/// How long the registrar may take over the next scan once all are sent.
const SCAN_DEADLINE: Duration = Duration::from_secs(120);
/// How long the mesh may take; each of its steps has a deadline of its own.
const FINISH_DEADLINE: Duration = Duration::from_secs(3600);

/// Publishes what a bag holds on the domain ROS_DOMAIN_ID: without --topics only what came from robot and sensor, so that
/// running nodes do with it what they did before.
#[derive(Args)]
pub struct Play {
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

impl Play {
    pub(super) fn run(&self) -> Result<()> {
        if !(self.rate >= 0.0 && self.rate.is_finite()) {
            return Err(usage(format!("--rate {}: must be 0 or more", self.rate)));
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
        let find = |name: &String| {
            topics.iter().find(|t| &*t.name == name).cloned().ok_or_else(|| {
                let known = topics.iter().map(|t| &*t.name).collect::<Vec<_>>().join(", ");
                usage(format!("--topics {name}: is not in the bag; there are {known}"))
            })
        };
        self.topics.iter().map(find).collect()
    }

    async fn play(
        &self,
        node: &Node<NoParams>,
        bag: &BagReader,
        chosen: &[BagTopic],
        stop: &Stop,
    ) -> Result<()> {
        let finish = if self.finish { Some(Finish::new(node)?) } else { None };
        let routes: Vec<_> = chosen.iter().map(topics::played).collect();
        let player = Player::new(node, &routes)?;
        let ready = stop.or(player.wait_for_readers(READERS_DEADLINE)).await;
        if let Err(error) = ready.ok_or_else(interrupted)? {
            if self.finish {
                return Err(error.context("the nodes must run before the bag is played"));
            }
            // A bag may hold more than anybody asks for.
            eprintln!("puffer: {error:#}; playing all the same");
        }
        let names: Vec<&str> = chosen.iter().map(|t| &*t.name).collect();
        let rate = Some(self.rate).filter(|rate| *rate > 0.0);
        let count = stop.or(player.play(bag.messages(&names)?, rate)).await;
        let count = count.ok_or_else(interrupted)??;
        stop.or(player.flush(FLUSH_DEADLINE)).await.ok_or_else(interrupted)??;
        eprintln!("{count} messages of {} topics on DDS domain {}", names.len(), node.domain());
        if let Some(finish) = finish {
            let clouds = chosen.iter().filter(|t| *t.type_name == *PointCloud2::TYPE_NAME);
            let scans = clouds.map(|t| t.count).sum();
            println!("{}", stop.or(finish.mesh(scans)).await.ok_or_else(interrupted)??);
        }
        Ok(())
    }
}

/// What makes a mesh of played scans.
struct Finish {
    registered: BulkSubscription<RegisteredScan>,
    modeller: Client<Trigger>,
}

impl Finish {
    fn new(node: &Node<NoParams>) -> Result<Finish> {
        Ok(Finish {
            registered: node.bulk_subscribe("registered_scan", Delivery::Every)?,
            modeller: node.client("modeller/finish")?,
        })
    }

    /// Waits for the verdict on each of `scans` scans, then for the mesh; its path.
    async fn mesh(&self, scans: u64) -> Result<String> {
        let mut ids = BTreeSet::new();
        while (ids.len() as u64) < scans {
            let next = tokio::time::timeout(SCAN_DEADLINE, self.registered.next()).await;
            let scan = next.map_err(|_| {
                anyhow!(
                    "{} of {scans} scans were registered, and no other for {} s: does scan_registrar run?",
                    ids.len(),
                    SCAN_DEADLINE.as_secs()
                )
            })?;
            ids.insert(scan.context("registered_scan")?.id);
        }
        let answer = self.modeller.call(&TriggerRequest::default(), FINISH_DEADLINE).await?;
        if !answer.success {
            bail!("the modeller: {}", answer.message);
        }
        Ok(answer.message)
    }
}
