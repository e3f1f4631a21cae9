//! The run folder: a scan folder that grows with each scan, and the report.

use crate::params::Params;
use anyhow::{Context, Result};
use puffer_core::geometry::{Pose, pose_to_rows};
use puffer_core::params::ParamValue;
use puffer_core::scan_files::{ScanFolder, ScanSet, View};
use puffer_core::view::TerminationCause;
use puffer_msgs::geometry_msgs::msg::Pose as PoseMessage;
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::srv::PlanViewResponse;
use puffer_ros::Stamp;
use puffer_ros::conversions::{pose_from_message, scan_from_message, status_from_message};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// What is noted of one run.
pub(crate) struct Journal {
    /// `None`: nothing is written.
    folder: Option<PathBuf>,
    scans: Option<ScanFolder>,
    /// What the report says of each view that was planned, the newest last.
    views: Vec<Map<String, Value>>,
    /// Wall time of each stage.
    stages: Vec<(&'static str, Duration)>,
    began: Instant,
    /// When the run began on the robot's clock.
    began_on_robot: Stamp,
}

impl Journal {
    /// A journal in the configured run folder that begins at the time `now` of the robot's clock.
    ///
    /// # Errors
    /// The run folder cannot be made.
    pub(crate) fn create(params: &Params, now: Stamp) -> Result<Journal> {
        let modeller = &params.modeller;
        let folder =
            Some(PathBuf::from(&modeller.run_folder)).filter(|f| !f.as_os_str().is_empty());
        let scans = match &folder {
            None => None,
            Some(folder) => {
                let set = ScanSet {
                    sensor: modeller.sensor.kind(),
                    pose_sigma: Some(params.scan.pose_sigma()),
                    support: modeller.support,
                    ..ScanSet::default()
                };
                Some(ScanFolder::create(&folder.join("scans"), set)?)
            }
        };
        Ok(Journal { folder, scans, ..Journal::without_folder(now) })
    }

    /// A journal of which nothing is written.
    pub(crate) fn without_folder(now: Stamp) -> Journal {
        Journal {
            folder: None,
            scans: None,
            views: Vec::new(),
            stages: Vec::new(),
            began: Instant::now(),
            began_on_robot: now,
        }
    }

    /// The run folder; empty if there is none.
    pub(crate) fn folder(&self) -> String {
        self.folder.as_deref().unwrap_or(Path::new("")).display().to_string()
    }

    /// Adds `time` to the wall time of a stage.
    pub(crate) fn add_stage_time(&mut self, stage: &'static str, time: Duration) {
        match self.stages.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, sum)) => *sum += time,
            None => self.stages.push((stage, time)),
        }
    }

    /// Notes a plan, with which a view begins.
    pub(crate) fn begin_view(&mut self, plan: &PlanViewResponse) {
        let candidates: Vec<Value> = plan
            .candidates
            .iter()
            .map(|c| {
                json!({
                    "view": pose_json(&c.view), "gain": c.gain, "asked": c.asked,
                    "reachable": c.reachable, "reason": c.reason,
                })
            })
            .collect();
        let refusals: Map<String, Value> = plan
            .refusals
            .iter()
            .cloned()
            .zip(plan.refusal_counts.iter().map(|count| json!(count)))
            .collect();
        let mut view = Map::new();
        for (key, value) in [
            ("view", pose_json(&plan.view)),
            ("done", json!(plan.done)),
            ("done_cause", done_cause_json(plan.done_cause)),
            ("not_worth_it", json!(plan.not_worth_it)),
            ("refusals", json!(refusals)),
            ("message", json!(plan.message)),
            ("expected_gain", json!(plan.expected_gain)),
            ("coverage", json!(plan.coverage)),
            ("voxel_edge", json!(plan.voxel_edge)),
            ("occupied", json!(plan.occupied)),
            ("satisfied", json!(plan.satisfied)),
            ("possible_border", json!(plan.possible_border)),
            ("possible_inside", json!(plan.possible_inside)),
            ("candidate_count", json!(plan.candidate_count)),
            ("candidates", json!(candidates)),
        ] {
            view.insert(key.to_owned(), value);
        }
        self.views.push(view);
    }

    /// Notes something of the view that was planned last.
    pub(crate) fn note(&mut self, key: &str, value: impl Into<Value>) {
        if let Some(view) = self.views.last_mut() {
            view.insert(key.to_owned(), value.into());
        }
    }

    /// Keeps a registered scan, in place of an earlier version of it.
    ///
    /// # Errors
    /// A message that does not fit, or a folder that cannot be written.
    pub(crate) fn keep(&mut self, message: &RegisteredScan) -> Result<()> {
        let verdict = verdict_json(message);
        let id = message.id;
        // Scans and views have the same numbers unless a motion or a scan failed in between, so the
        // scan's number is noted as well.
        match self.views.iter_mut().find(|view| view.get("scan") == Some(&json!(id))) {
            Some(view) => view.insert("verdict".to_owned(), verdict.clone()),
            None => self.views.last_mut().and_then(|view| {
                view.insert("scan".to_owned(), json!(id));
                view.insert("verdict".to_owned(), verdict.clone())
            }),
        };
        // A scan without covariance could not be judged: it is kept out of the scan folder.
        let judged = message.object_from_sensor.covariance.iter().any(|v| *v != 0.0);
        if message.cloud.width == 0 || !judged {
            return Ok(());
        }
        if let Some(scans) = &mut self.scans {
            let prior: Pose = pose_from_message(&message.prior).map_err(anyhow::Error::msg)?;
            let view = View {
                name: format!("view_{id:03}"),
                scan: scan_from_message(&message.cloud).map_err(anyhow::Error::msg)?,
                object_from_sensor: prior,
            };
            scans.write_view(&view, json!({ "verdict": verdict }))?;
            scans.save()?;
        }
        Ok(())
    }

    /// Writes the report with `facts` added, at the time `now` of the robot's clock.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(crate) fn write(&self, now: Stamp, facts: &Map<String, Value>) -> Result<()> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let stages: Map<String, Value> = self
            .stages
            .iter()
            .map(|(name, time)| ((*name).to_owned(), json!(time.as_secs_f64())))
            .collect();
        let mut report = json!({
            "views": self.views,
            "stage_seconds": stages,
            "seconds": self.began.elapsed().as_secs_f64(),
            "simulated_seconds": now.seconds_since(self.began_on_robot),
        });
        if let Some(report) = report.as_object_mut() {
            report.extend(facts.clone());
        }
        let path = folder.join("report.json");
        let text = format!("{report:#}\n");
        // It is renamed when it is complete: an interrupted run leaves the report before it.
        let part = folder.join("report.json.part");
        std::fs::write(&part, text)
            .and_then(|()| std::fs::rename(&part, &path))
            .with_context(|| format!("cannot write {}", path.display()))
    }
}

/// The rows of a pose's matrix; null if it is none.
fn pose_json(pose: &PoseMessage) -> Value {
    pose_from_message(pose).map_or(Value::Null, |pose| json!(pose_to_rows(&pose)))
}

/// The word for why no view is left; null if one is.
fn done_cause_json(code: u8) -> Value {
    let cause = match code {
        PlanViewResponse::NO_FIRST_VIEW => TerminationCause::NoFirstView,
        PlanViewResponse::NOTHING_ASKS => TerminationCause::NothingAsks,
        PlanViewResponse::NOT_WORTH_IT => TerminationCause::NotWorthIt,
        PlanViewResponse::REFUSED => TerminationCause::Refused,
        _ => return Value::Null,
    };
    cause.to_value()
}

/// The registrar's verdict on a scan.
fn verdict_json(message: &RegisteredScan) -> Value {
    let status = status_from_message(message.status).map_or("unknown", |status| status.word());
    let covariance: Vec<&[f64]> = message.object_from_sensor.covariance.chunks(6).collect();
    let free: Vec<&[f64]> = message.free_directions.chunks(6).collect();
    json!({
        "status": status,
        "reason": message.reason,
        "fitness": message.fitness,
        "overlap": message.overlap,
        "rmse": Some(message.rmse).filter(|v| v.is_finite()),
        "correspondences": message.correspondences,
        "covariance": covariance,
        "free_directions": free,
        "points": message.cloud.width,
    })
}
