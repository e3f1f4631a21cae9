//! The figures of a case, and how they are printed.

use super::Case;
use super::found::{Found, Pair, reported};
use anyhow::Result;
use puffer_core::Progress;
use puffer_core::assess::{PoseErrors, PosedHits, pose_errors};
use puffer_core::geometry::{Pose, Vec3};
use puffer_core::mesh::Mesh;
use puffer_core::simulate::{SimulatedScans, SimulatedView};
use serde_json::{Value, json};

/// Hits of a case that are compared at most; more change no figure by a per cent.
const HITS: usize = 60_000;

/// A pair whose error is larger has failed, mm.
const FAILED: f64 = 5.0;

/// What came out of one case.
pub(super) struct Row {
    case: Case,
    found: Found,
    robot: PoseErrors,
    ours: PoseErrors,
    /// Root mean square distance between where the estimated and the true pose put the hits of each pair's moving scan,
    /// mm.
    pair_errors: Vec<f64>,
}

pub(super) fn measure(
    case: Case,
    truth: &Mesh,
    scans: &SimulatedScans,
    found: Found,
) -> Result<Row> {
    let ours = posed(scans, &found.poses);
    let errors = |views: &[PosedHits]| pose_errors(views, truth, &Progress::silent());
    Ok(Row {
        robot: errors(&posed(scans, &reported(scans)))?,
        pair_errors: found.pairs.iter().map(|pair| pair_error(pair, &ours)).collect(),
        ours: errors(&ours)?,
        case,
        found,
    })
}

fn pair_error(pair: &Pair, views: &[PosedHits]) -> f64 {
    let truth = views[pair.fixed].truth.inverse() * views[pair.moving].truth;
    let hits = &views[pair.moving].hits;
    let place = |pose: &Pose, hit: &Vec3| pose.rotation * hit + pose.translation.vector;
    let square = |hit| (place(&pair.fixed_from_moving, hit) - place(&truth, hit)).norm_squared();
    (hits.iter().map(square).sum::<f64>() / hits.len() as f64).sqrt() * 1e3
}

fn posed(scans: &SimulatedScans, poses: &[Pose]) -> Vec<PosedHits> {
    let all: usize = scans.views.iter().map(|v| v.scan.returns().count()).sum();
    let step = all.div_ceil(HITS).max(1);
    let hits = |hits: &[[f32; 3]]| -> Vec<Vec3> {
        let met = hits.iter().filter(|h| h[0].is_finite());
        met.step_by(step).map(|h| Vec3::from(h.map(f64::from))).collect()
    };
    let view = |(v, pose): (&SimulatedView, &Pose)| PosedHits {
        hits: hits(&v.hits),
        truth: v.true_pose,
        estimate: *pose,
    };
    scans.views.iter().zip(poses).map(view).collect()
}

pub(super) fn heading() -> String {
    "errors in mm: along the normal, full, of the surface; in brackets the robot's own\n".to_owned()
}

fn figures(ours: &PoseErrors, robot: &PoseErrors) -> String {
    format!(
        "normal {:6.3} ({:5.2})  full {:6.3} ({:5.2})  surface {:6.3} ({:5.2})",
        ours.normal, robot.normal, ours.full, robot.full, ours.surface, robot.surface
    )
}

pub(super) fn worst(rows: &[Row]) -> String {
    let largest = |of: fn(&Row) -> f64| rows.iter().map(of).fold(0.0, f64::max);
    let ours = PoseErrors {
        normal: largest(|r| r.ours.normal),
        full: largest(|r| r.ours.full),
        surface: largest(|r| r.ours.surface),
    };
    let robot = PoseErrors {
        normal: largest(|r| r.robot.normal),
        full: largest(|r| r.robot.full),
        surface: largest(|r| r.robot.surface),
    };
    let refused = rows.iter().map(|r| r.found.refused).max().unwrap_or(0);
    format!(
        "{:<12} {:<4} worst  {}  refused {refused}\n",
        rows[0].case.object,
        format!("{:?}", rows[0].case.family),
        figures(&ours, &robot)
    )
}

impl Row {
    pub(super) fn line(&self) -> String {
        format!(
            "{:<12} {:<4} {:>5}  {}  refused {}  prepare {:.1} s, register {:.1} s\n",
            self.case.object,
            format!("{:?}", self.case.family),
            self.case.seed,
            figures(&self.ours, &self.robot),
            self.found.refused,
            self.found.prepare,
            self.found.register
        ) + &self.pairs_line()
    }

    fn pairs_line(&self) -> String {
        let times: Vec<f64> = self.found.pairs.iter().map(|p| p.milliseconds).collect();
        format!(
            "{:24}pairs: error median {:.3}, 90 % {:.3}; {} of {} said to succeed, {} of these beyond {FAILED} mm; \
             median {:.1} ms\n",
            "",
            quantile(&self.pair_errors, 0.5),
            quantile(&self.pair_errors, 0.9),
            self.found.pairs.iter().filter(|p| p.accepted).count(),
            times.len(),
            self.false_successes(),
            quantile(&times, 0.5)
        )
    }

    fn false_successes(&self) -> usize {
        let failed = |(pair, error): &(&Pair, &f64)| pair.accepted && **error > FAILED;
        self.found.pairs.iter().zip(&self.pair_errors).filter(failed).count()
    }

    pub(super) fn json(&self) -> Value {
        let errors =
            |e: &PoseErrors| json!({ "normal": e.normal, "full": e.full, "surface": e.surface });
        json!({
            "object": self.case.object, "noise": format!("{:?}", self.case.family),
            "seed": self.case.seed, "found": errors(&self.ours), "robot": errors(&self.robot),
            "refused": self.found.refused, "prepare_seconds": self.found.prepare,
            "register_seconds": self.found.register, "pair_errors": self.pair_errors,
            "pair_milliseconds":
                self.found.pairs.iter().map(|p| p.milliseconds).collect::<Vec<f64>>(),
            "pairs_accepted": self.found.pairs.iter().map(|p| p.accepted).collect::<Vec<bool>>(),
        })
    }
}

/// The value below which the share `fraction` lies; NaN of nothing.
fn quantile(values: &[f64], fraction: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1) as f64;
    sorted.get((fraction * last).round() as usize).copied().unwrap_or(f64::NAN)
}
