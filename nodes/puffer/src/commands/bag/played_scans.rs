//! Playing no faster than the scans are registered, and the mesh of them.

use anyhow::{Result, anyhow, bail};
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::std_srvs::srv::{Trigger, TriggerRequest};
use puffer_ros::bag::BagMessage;
use puffer_ros::large_data::{Delivery, LargeDataSubscription};
use puffer_ros::{Client, NoParams, Node, Stamp};
use std::collections::BTreeSet;
use std::time::Duration;
use tokio::sync::watch;

/// How long the registrar may take over the next scan.
const SCAN_DEADLINE: Duration = Duration::from_secs(120);
/// How long the mesh may take; each of its steps has a deadline of its own.
const FINISH_DEADLINE: Duration = Duration::from_secs(3600);
/// Time of the bag that goes on after a scan, for the transforms that lie about its stamp, seconds.
const TRANSFORM_LEAD_S: f64 = 1.0;

/// The bag waits for the verdict on a scan, as the robot did: transforms and clock would run away
/// from a registrar that is slower than the rate.
#[derive(Default)]
pub(super) struct ScanPacing {
    /// Clouds let through.
    pub clouds: usize,
    /// When the last was recorded, until its verdict came.
    last: Option<Stamp>,
}

impl ScanPacing {
    /// Waits until `message` may go out; those of the topics `clouds` are scans.
    pub(super) async fn wait_for_turn(
        &mut self,
        message: &BagMessage,
        clouds: &BTreeSet<&str>,
        scans: &PlayedScans,
    ) -> Result<()> {
        let is_cloud = clouds.contains(&*message.topic);
        let is_due = self.last.is_some_and(|last| {
            is_cloud || message.log_time.seconds_since(last) > TRANSFORM_LEAD_S
        });
        if is_due {
            scans.wait_for_verdicts(self.clouds).await?;
            self.last = None;
        }
        if is_cloud {
            self.clouds += 1;
            self.last = Some(message.log_time);
        }
        Ok(())
    }
}

/// What makes a mesh of played scans.
pub(super) struct PlayedScans {
    /// Number of scans with a verdict.
    registered: watch::Receiver<usize>,
    modeller: Client<Trigger>,
}

impl PlayedScans {
    pub(super) fn new(node: &Node<NoParams>) -> Result<PlayedScans> {
        let scans = node.large_data_subscribe("registered_scan", Delivery::Every)?;
        let (count, registered) = watch::channel(0);
        tokio::spawn(count_verdicts(scans, count));
        Ok(PlayedScans { registered, modeller: node.client("modeller/finish")? })
    }

    /// Waits for the verdict on each of `scans` scans.
    async fn wait_for_verdicts(&self, scans: usize) -> Result<()> {
        let mut registered = self.registered.clone();
        while *registered.borrow_and_update() < scans {
            let next = tokio::time::timeout(SCAN_DEADLINE, registered.changed()).await;
            next.map_err(|_| {
                anyhow!(
                    "{} of {scans} scans were registered, and no other for {} s: does scan_registrar run?",
                    *self.registered.borrow(),
                    SCAN_DEADLINE.as_secs()
                )
            })?
            .map_err(|_| anyhow!("registered_scan: the subscription ended"))?;
        }
        Ok(())
    }

    /// Waits for the verdict on each of `scans` scans, then for the mesh; its path.
    pub(super) async fn make_mesh(&self, scans: usize) -> Result<String> {
        self.wait_for_verdicts(scans).await?;
        let answer = self.modeller.call(&TriggerRequest::default(), FINISH_DEADLINE).await?;
        if !answer.success {
            bail!("the modeller: {}", answer.message);
        }
        Ok(answer.message)
    }
}

async fn count_verdicts(scans: LargeDataSubscription<RegisteredScan>, count: watch::Sender<usize>) {
    let mut ids = BTreeSet::new();
    loop {
        match scans.next().await {
            Ok(scan) => {
                ids.insert(scan.id);
                if count.send(ids.len()).is_err() {
                    return;
                }
            }
            Err(error) => {
                tracing::error!("registered_scan: {error:#}");
                return;
            }
        }
    }
}
