//! The service `~/finish`: a mesh of the scans that the nodes hold, for scans that came from a bag or by hand.

use crate::Params;
use crate::goal::Modeller;
use anyhow::{Result, anyhow, bail};
use puffer_msgs::action::ReconstructMeshGoal;
use puffer_msgs::std_srvs::srv::{Trigger, TriggerResponse};
use puffer_shell::Node;
use std::sync::Arc;

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
    /// The last three commands of a session; the mesh's path.
    async fn finish(&self) -> Result<String> {
        let Some(_claim) = self.busy.claim() else {
            bail!("an object is being modelled: cancel that, or let it come to its end");
        };
        self.refine_filter_reconstruct().await
    }

    async fn refine_filter_reconstruct(&self) -> Result<String> {
        self.partners.ready_to_finish().await?;
        if self.inbox.len() == 0 {
            bail!("no registered_scan came yet");
        }
        let stop = self.node.stop().child();
        let refined = self.partners.refine(self.inbox.len(), &stop).await?;
        // Scans that came meanwhile are not in the revision, but must not be missed by the filter either.
        let filtered = self.partners.filter(self.inbox.len(), refined.revision).await?;
        let goal = ReconstructMeshGoal {
            cloud_hash: filtered.cloud_hash,
            scans: self.inbox.len() as u32,
            accepted: refined.accepted,
            ..ReconstructMeshGoal::default()
        };
        let mesh = self.partners.reconstruct(goal, &stop).await?;
        if !mesh.success {
            return Err(anyhow!(mesh.error_msg));
        }
        Ok(mesh.mesh_path)
    }
}
