//! The action that optimises all poses together.

use crate::Params;
use crate::messages::{registered_poses_message, registered_scan_message};
use anyhow::Result;
use puffer_core::Error;
use puffer_core::intake::Intake;
use puffer_core::register::Registration;
use puffer_msgs::action::{Refine, RefineFeedback, RefineGoal, RefineResult};
use puffer_msgs::msg::{RegisteredPoses, RegisteredScan};
use puffer_ros::large_data::{LargeDataPublisher, Retention};
use puffer_ros::{Goal, Node, Outcome, Shared};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// How long a goal waits for the scans that it says were taken.
const SCANS_DEADLINE: Duration = Duration::from_secs(30);
/// How long a goal waits for the readers of the poses.
const FLUSH_DEADLINE: Duration = Duration::from_secs(10);

/// Offers `~/refine` and publishes `registered_poses`.
pub(crate) fn serve_refine(
    node: &Node<Params>,
    intake: &Shared<Intake>,
    scans: &Arc<LargeDataPublisher>,
) -> Result<()> {
    let refiner = Arc::new(Refiner {
        node: node.clone(),
        intake: intake.clone(),
        poses: node.large_data_publisher("registered_poses", Retention::Latched)?,
        scans: Arc::clone(scans),
        revision: AtomicU32::new(0),
    });
    node.action_server::<Refine, _, _, _>(
        "~/refine",
        |_: &RefineGoal| Ok(()),
        move |goal: Goal<Refine>| {
            let refiner = Arc::clone(&refiner);
            async move { refiner.refine(goal).await }
        },
    )
}

/// Refines the poses of the scans that were taken in.
struct Refiner {
    node: Node<Params>,
    intake: Shared<Intake>,
    poses: LargeDataPublisher,
    scans: Arc<LargeDataPublisher>,
    revision: AtomicU32,
}

impl Refiner {
    async fn refine(&self, goal: Goal<Refine>) -> Outcome<RefineResult> {
        if let Err(reason) = self.wait_for_scans(goal.request().scans as usize).await {
            return failed(RefineResult::SCANS_MISSING, reason);
        }
        let mut intake = self.intake.lock().await;
        if intake.usable_ids().is_empty() {
            return failed(RefineResult::SCANS_MISSING, "there is no usable scan yet".into());
        }
        let progress = goal.progress(|stage, fraction| RefineFeedback {
            stage: stage.to_owned(),
            fraction: fraction as f32,
        });
        let refined = tokio::task::block_in_place(|| intake.refine(&progress));
        drop(progress);
        let registration = match refined {
            Ok(registration) => registration,
            Err(Error::Cancelled) => {
                return Outcome::Canceled(error_result(
                    RefineResult::CANCELLED,
                    "cancelled".into(),
                ));
            }
            Err(error) => return failed(RefineResult::FAILED, error.to_string()),
        };
        let revision = self.revision.fetch_add(1, Ordering::Relaxed) + 1;
        let object = self.node.params().scan.object_frame;
        let message =
            registered_poses_message(&intake, &registration, revision, self.node.now(), &object);
        // The points that count as the object's have changed with the poses.
        let scans: Vec<RegisteredScan> = intake
            .usable_ids()
            .into_iter()
            .map(|id| registered_scan_message(id, &intake, &object))
            .collect();
        drop(intake);
        if let Err(error) = self.publish(&scans, &message).await {
            return failed(RefineResult::FAILED, error.to_string());
        }
        Outcome::Succeeded(success_result(&registration, message))
    }

    /// Publishes the scans, then their poses, and waits for the readers of the poses.
    async fn publish(&self, scans: &[RegisteredScan], poses: &RegisteredPoses) -> Result<()> {
        for scan in scans {
            self.scans.publish_message(scan).await?;
        }
        self.poses.publish_message(poses).await?;
        if let Err(error) = self.poses.flush(FLUSH_DEADLINE).await {
            // A reader that lacks the poses waits for this revision of them.
            tracing::warn!("{error}");
        }
        Ok(())
    }

    async fn wait_for_scans(&self, scans: usize) -> std::result::Result<(), String> {
        let deadline = SCANS_DEADLINE;
        let waited = self.intake.wait_until(deadline, |intake| match intake.len() {
            there if there >= scans => Ok(()),
            there => Err(format!("{there} of {scans} scans came within {} s", deadline.as_secs())),
        });
        waited.await
    }
}

/// The result of a refinement whose poses were published in `message`.
fn success_result(registration: &Registration, message: RegisteredPoses) -> RefineResult {
    let count = registration.verdicts.len();
    let accepted = registration.verdicts.iter().filter(|v| v.is_accepted()).count();
    tracing::info!(
        "refined: {accepted} of {count} scans, {:.3} mm between them",
        message.residual * 1e3
    );
    RefineResult {
        success: true,
        revision: message.revision,
        accepted: accepted as u32,
        refused: (count - accepted) as u32,
        residual: message.residual,
        ids: message.ids,
        versions: message.versions,
        status: message.status,
        ..RefineResult::default()
    }
}

fn error_result(error_code: u16, error_msg: String) -> RefineResult {
    RefineResult { success: false, error_code, error_msg, ..RefineResult::default() }
}

fn failed(error_code: u16, reason: String) -> Outcome<RefineResult> {
    tracing::error!("not refined: {reason}");
    Outcome::Aborted(error_result(error_code, reason))
}
