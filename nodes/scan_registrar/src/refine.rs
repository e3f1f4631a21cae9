//! The action that optimises all poses together.

use crate::{Params, messages};
use anyhow::Result;
use puffer_core::register::Status;
use puffer_core::{Error, Progress};
use puffer_msgs::action::{Refine, RefineFeedback, RefineGoal, RefineResult};
use puffer_msgs::msg::RegisteredScan;
use puffer_shell::bulk::{BulkPublisher, Mode};
use puffer_shell::scans::Intake;
use puffer_shell::{Goal, Node, Outcome};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::Mutex;

/// How long it waits for scans that the goal says were taken.
const SCANS_DEADLINE: Duration = Duration::from_secs(30);
/// How long it waits for the readers of the poses.
const FLUSH_DEADLINE: Duration = Duration::from_secs(10);

/// Offers `~/refine` and publishes `registered_poses`.
pub(crate) fn serve(
    node: &Node<Params>,
    intake: &Arc<Mutex<Intake>>,
    scans: &Arc<BulkPublisher>,
) -> Result<()> {
    let desk = Arc::new(Desk {
        node: node.clone(),
        intake: Arc::clone(intake),
        poses: node.bulk_publisher("registered_poses", Mode::Latched)?,
        scans: Arc::clone(scans),
        revision: AtomicU32::new(0),
    });
    node.action_server::<Refine, _, _, _>(
        "~/refine",
        |_: &RefineGoal| Ok(()),
        move |goal: Goal<Refine>| {
            let desk = Arc::clone(&desk);
            async move { desk.refine(goal).await }
        },
    )
}

struct Desk {
    node: Node<Params>,
    intake: Arc<Mutex<Intake>>,
    poses: BulkPublisher,
    scans: Arc<BulkPublisher>,
    revision: AtomicU32,
}

impl Desk {
    async fn refine(&self, goal: Goal<Refine>) -> Outcome<RefineResult> {
        if let Err(reason) = self.wait_for(goal.request().scans as usize).await {
            return failed(RefineResult::SCANS_MISSING, reason);
        }
        let mut intake = self.intake.lock().await;
        if intake.usable().is_empty() {
            return failed(RefineResult::SCANS_MISSING, "there is no usable scan yet".into());
        }
        let report = goal.clone();
        let progress = Progress::to(move |stage, fraction| {
            let stage = stage.to_owned();
            report.feedback(&RefineFeedback { stage, fraction: fraction as f32 });
        });
        let watch = tokio::spawn({
            let (goal, progress) = (goal.clone(), progress.clone());
            async move {
                goal.cancelled().await;
                progress.cancel();
            }
        });
        let refined = tokio::task::block_in_place(|| intake.refine(&progress));
        watch.abort();
        let registration = match refined {
            Ok(registration) => registration,
            Err(Error::Cancelled) => {
                return Outcome::Canceled(result(RefineResult::CANCELLED, "cancelled".into()));
            }
            Err(error) => return failed(RefineResult::FAILED, error.to_string()),
        };
        let revision = self.revision.fetch_add(1, Ordering::Relaxed) + 1;
        let object = self.node.params().scan.object_frame;
        let message = messages::poses(&intake, &registration, revision, self.node.now(), &object);
        // Their points have changed with the poses.
        let scans: Vec<RegisteredScan> =
            intake.usable().into_iter().map(|id| messages::scan(id, &intake, &object)).collect();
        drop(intake);
        for scan in &scans {
            if let Err(error) = self.scans.publish_message(scan).await {
                return failed(RefineResult::FAILED, error.to_string());
            }
        }
        if let Err(error) = self.poses.publish_message(&message).await {
            return failed(RefineResult::FAILED, error.to_string());
        }
        if let Err(error) = self.poses.flush(FLUSH_DEADLINE).await {
            // Whoever lacks them waits for the revision.
            tracing::warn!("{error}");
        }
        let accepted =
            registration.verdicts.iter().filter(|v| v.status == Status::Accepted).count();
        tracing::info!(
            "refined: {accepted} of {} scans, {:.3} mm between them",
            registration.verdicts.len(),
            registration.residual * 1e3
        );
        Outcome::Succeeded(RefineResult {
            success: true,
            revision,
            accepted: accepted as u32,
            refused: (registration.verdicts.len() - accepted) as u32,
            residual: registration.residual,
            ids: message.ids,
            versions: message.versions,
            status: message.status,
            ..RefineResult::default()
        })
    }

    async fn wait_for(&self, scans: usize) -> std::result::Result<(), String> {
        let since = Instant::now();
        loop {
            let there = self.intake.lock().await.len();
            if there >= scans {
                return Ok(());
            }
            if since.elapsed() > SCANS_DEADLINE {
                return Err(format!(
                    "{there} of {scans} scans came within {} s",
                    SCANS_DEADLINE.as_secs()
                ));
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
}

fn result(error_code: u16, error_msg: String) -> RefineResult {
    RefineResult { success: false, error_code, error_msg, ..RefineResult::default() }
}

fn failed(error_code: u16, reason: String) -> Outcome<RefineResult> {
    tracing::error!("not refined: {reason}");
    Outcome::Aborted(result(error_code, reason))
}
