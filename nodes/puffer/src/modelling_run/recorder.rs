//! The bag of a run: everything that is published.

use crate::commands::bag::topics;
use anyhow::{Context, Result};
use puffer_ros::bag::{BagWriter, Recording};
use puffer_ros::scans::RUN_METADATA_NAME;
use puffer_ros::{NoParams, Node, RosArgs, Stop};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// How long the last messages may take to be written.
const CLOSE_DEADLINE: Duration = Duration::from_secs(60);

/// A recording, with a node and a stop of its own: it goes on while everything else is being ended.
pub(super) struct RunRecorder {
    recording: Recording,
    stop: Stop,
    _node: Node<NoParams>,
}

impl RunRecorder {
    /// Starts to record into the new file `path`; `notes` come first.
    ///
    /// # Errors
    /// A file that cannot be made, or no network.
    pub(super) async fn start(
        domain: u16,
        path: &Path,
        notes: BTreeMap<String, String>,
    ) -> Result<RunRecorder> {
        let mut bag = BagWriter::create(path)?;
        bag.write_metadata(RUN_METADATA_NAME, &notes)?;
        // The robot's clock, so that the bag is played at the pace of the robot.
        let args = ["--ros-args", "-p", "use_sim_time:=true"].map(str::to_owned);
        let args = RosArgs::parse(args)?.with_domain(domain);
        let stop = Stop::new();
        let node = Node::start("puffer_bag", args, stop.clone()).await?;
        let recording = Recording::start(&node, &topics::suite_routes(), bag)?;
        Ok(RunRecorder { recording, stop, _node: node })
    }

    /// Ends the recording and closes the bag.
    ///
    /// # Errors
    /// What kept it from being whole.
    pub(super) async fn stop(self) -> Result<()> {
        self.stop.stop();
        let closed = tokio::time::timeout(CLOSE_DEADLINE, self.recording.finished()).await;
        closed.context("the bag was not closed in time")?.context("bag.mcap")?;
        Ok(())
    }
}
