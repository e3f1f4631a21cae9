//! What a run leaves: a scan folder that grows with each scan, and the report.

use crate::Params;
use anyhow::{Context, Result};
use puffer_core::geometry::{Pose, pose_to_rows};
use puffer_core::params::ParamValue;
use puffer_core::scans::{ScanFolder, ScanSet, View};
use puffer_core::view::Cause;
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::srv::PlanViewResponse;
use puffer_shell::Stamp;
use puffer_shell::convert::{pose_from_message, scan_from_message, status_from_message};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The journal of one run.
pub(crate) struct Journal {
    folder: Option<PathBuf>,
    scans: Option<ScanFolder>,
    views: Vec<Map<String, Value>>,
    stages: Vec<(&'static str, Duration)>,
    began: Instant,
    simulated: Stamp,
}

impl Journal {
    /// Begins a journal at the time `now` of the robot's clock.
    ///
    /// # Errors
    /// The run folder cannot be made.
    pub(crate) fn begin(params: &Params, now: Stamp) -> Result<Journal> {
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
        let (views, stages) = (Vec::new(), Vec::new());
        Ok(Journal { folder, scans, views, stages, began: Instant::now(), simulated: now })
    }

    /// The run folder; empty if there is none.
    pub(crate) fn folder(&self) -> String {
        self.folder.as_deref().unwrap_or(Path::new("")).display().to_string()
    }

    /// Adds up the time of a stage.
    pub(crate) fn took(&mut self, stage: &'static str, time: Duration) {
        match self.stages.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, sum)) => *sum += time,
            None => self.stages.push((stage, time)),
        }
    }

    /// Notes a plan: a view begins with it.
    pub(crate) fn planned(&mut self, plan: &PlanViewResponse) {
        let rows = |pose| pose_from_message(pose).map_or(Value::Null, |p| json!(pose_to_rows(&p)));
        let candidates: Vec<Value> = plan
            .candidates
            .iter()
            .map(|c| {
                json!({
                    "view": rows(&c.view), "gain": c.gain, "asked": c.asked,
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
            ("view", rows(&plan.view)),
            ("done", json!(plan.done)),
            ("done_cause", cause(plan.done_cause)),
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
    pub(crate) fn keep(&mut self, message: &RegisteredScan) -> Result<()> {
        let verdict = verdict(message);
        let id = message.id;
        // Scans and views go together unless a motion or a scan failed in between: the number is noted, too.
        match self.views.iter_mut().find(|view| view.get("scan") == Some(&json!(id))) {
            Some(view) => view.insert("verdict".to_owned(), verdict.clone()),
            None => self.views.last_mut().and_then(|view| {
                view.insert("scan".to_owned(), json!(id));
                view.insert("verdict".to_owned(), verdict.clone())
            }),
        };
        // Without a verdict it is not registered, whoever tries: it has no place among the scans.
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
            scans.put(&view, json!({ "verdict": verdict }))?;
            scans.save()?;
        }
        Ok(())
    }

    /// Writes the report; `end` is added to it.
    pub(crate) fn write(&self, now: Stamp, end: &Map<String, Value>) -> Result<()> {
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
            "simulated_seconds": now.seconds_since(self.simulated),
        });
        if let Some(report) = report.as_object_mut() {
            report.extend(end.clone());
        }
        let path = folder.join("report.json");
        let text = format!("{report:#}\n");
        // Renamed when it is whole: an interrupted run leaves the one before.
        let part = folder.join("report.json.part");
        std::fs::write(&part, text)
            .and_then(|()| std::fs::rename(&part, &path))
            .with_context(|| format!("cannot write {}", path.display()))
    }
}

/// The word for why no view is left; null if one is.
fn cause(code: u8) -> Value {
    let cause = match code {
        PlanViewResponse::NO_FIRST_VIEW => Cause::NoFirstView,
        PlanViewResponse::NOTHING_ASKS => Cause::NothingAsks,
        PlanViewResponse::NOT_WORTH_IT => Cause::NotWorthIt,
        PlanViewResponse::REFUSED => Cause::Refused,
        _ => return Value::Null,
    };
    cause.to_value()
}

fn verdict(message: &RegisteredScan) -> Value {
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
