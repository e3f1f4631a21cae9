//! The service `~/finish`: a mesh of the scans that the nodes hold, for scans that came from a bag
//! or were taken by hand.

use crate::goal::Modeller;
use crate::journal::Journal;
use crate::params::Params;
use crate::runner::Runner;
use anyhow::{Result, anyhow, bail};
use puffer_core::session::{Event, SessionOutcome, SessionParams, SessionState};
use puffer_msgs::action::ModelObjectGoal;
use puffer_msgs::std_srvs::srv::{Trigger, TriggerResponse};
use puffer_ros::Node;
use std::sync::Arc;
use tokio::sync::mpsc::unbounded_channel;

/// Offers `~/finish`.
pub(crate) fn serve(node: &Node<Params>, modeller: &Arc<Modeller>) -> Result<()> {
    let modeller = Arc::clone(modeller);
    node.serve::<Trigger, _, _>("~/finish", move |_| {
        let modeller = Arc::clone(&modeller);
        async move {
            match modeller.finish().await {
                Ok(message) => TriggerResponse { success: true, message },
                Err(error) => {
                    tracing::error!("not finished: {error:#}");
                    TriggerResponse { success: false, message: format!("{error:#}") }
                }
            }
        }
    })
}

impl Modeller {
    /// Runs the end of a session, from refining on; the mesh's path.
    async fn finish(&self) -> Result<String> {
        let Some(_claim) = self.busy.claim() else {
            bail!("an object is being modelled: cancel that, or let it come to its end");
        };
        self.clients.wait_for_meshing_nodes().await?;
        let scans = self.inbox.len();
        if scans == 0 {
            bail!("no registered_scan came yet");
        }
        // Nobody steers it: the sender stays open so that no control ends it.
        let (_no_controls, controls) = unbounded_channel();
        let journal = Journal::without_folder(self.node.now());
        let (goal, stop) = (ModelObjectGoal::default(), self.node.stop());
        let mut runner = Runner::new(&self.clients, &self.inbox, journal, goal, stop);
        let session = SessionState::with_scans(SessionParams::default(), scans);
        match runner.run(session, Event::Ready, controls, |_, _| {}).await.outcome {
            SessionOutcome::Modelled(_) => Ok(runner.mesh.mesh_path),
            SessionOutcome::Failed(_, why) => Err(anyhow!(why)),
            SessionOutcome::Cancelled => Err(anyhow!("cancelled")),
        }
    }
}
