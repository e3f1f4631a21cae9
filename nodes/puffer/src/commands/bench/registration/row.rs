//! The figures of a case, and how they are printed.

use super::Case;
use super::found::{Found, Pair, reported};
use anyhow::Result;
use puffer_core::Progress;
use puffer_core::assess::{PoseErrors, PosedHits, pair_error, pose_errors, quantile};
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
    errors: PoseErrors,
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
    let posed_hits = posed(scans, &found.poses);
    let errors = |views: &[PosedHits]| pose_errors(views, truth, &Progress::silent());
    Ok(Row {
        robot: errors(&posed(scans, &reported(scans)))?,
        pair_errors: found
            .pairs
            .iter()
            .map(|p| pair_error(&posed_hits[p.moving], &posed_hits[p.fixed], &p.fixed_from_moving))
            .collect(),
        errors: errors(&posed_hits)?,
        case,
        found,
    })
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

/// The heading of a table of variants of `case`.
pub(super) fn variants_heading(case: &Case) -> String {
    format!(
        "{}: errors of all scans in mm, time in s; pairs: median error in mm, share beyond {FAILED} mm in %, time in ms\n  \
         {:<24} {:>8} {:>8} {:>8} {:>8} {:>7} {:>8} {:>7} {:>7}\n",
        case.name(),
        "",
        "normal",
        "full",
        "surface",
        "refused",
        "s",
        "pairs",
        "%",
        "ms"
    )
}

fn figures(found: &PoseErrors, robot: &PoseErrors) -> String {
    format!(
        "normal {:6.3} ({:5.2})  full {:6.3} ({:5.2})  surface {:6.3} ({:5.2})",
        found.normal, robot.normal, found.full, robot.full, found.surface, robot.surface
    )
}

pub(super) fn worst(rows: &[Row]) -> String {
    let largest = |of: fn(&Row) -> &PoseErrors| {
        let of_all =
            |part: fn(&PoseErrors) -> f64| rows.iter().map(of).map(part).fold(0.0, f64::max);
        PoseErrors {
            normal: of_all(|e| e.normal),
            full: of_all(|e| e.full),
            surface: of_all(|e| e.surface),
        }
    };
    let refused = rows.iter().filter_map(|r| r.found.refused).max();
    format!(
        "{:<12} {:<4} worst  {}  {}\n",
        rows[0].case.object,
        format!("{:?}", rows[0].case.family),
        figures(&largest(|r| &r.errors), &largest(|r| &r.robot)),
        refusals(refused).trim_end()
    )
}

/// Empty for a program that refuses nothing.
fn refusals(refused: Option<usize>) -> String {
    refused.map(|count| format!("refused {count}  ")).unwrap_or_default()
}

impl Row {
    pub(super) fn line(&self) -> String {
        format!(
            "{:<12} {:<4} {:>5}  {}  {}{}register {:.1} s\n",
            self.case.object,
            format!("{:?}", self.case.family),
            self.case.seed,
            figures(&self.errors, &self.robot),
            refusals(self.found.refused),
            self.found.prepare.map(|s| format!("prepare {s:.1} s, ")).unwrap_or_default(),
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

    /// The row of a table of variants of this case.
    pub(super) fn variant_line(&self, variant: &str) -> String {
        let times: Vec<f64> = self.found.pairs.iter().map(|p| p.milliseconds).collect();
        let failed = self.pair_errors.iter().filter(|error| **error > FAILED).count();
        format!(
            "  {variant:<24} {:>8.3} {:>8.3} {:>8.3} {:>8} {:>7.1} {:>8.3} {:>7.1} {:>7.1}\n",
            self.errors.normal,
            self.errors.full,
            self.errors.surface,
            self.found.refused.map_or_else(|| "-".to_owned(), |count| count.to_string()),
            self.found.register,
            quantile(&self.pair_errors, 0.5),
            100.0 * failed as f64 / self.pair_errors.len().max(1) as f64,
            quantile(&times, 0.5)
        )
    }

    pub(super) fn json(&self) -> Value {
        let errors =
            |e: &PoseErrors| json!({ "normal": e.normal, "full": e.full, "surface": e.surface });
        json!({
            "object": self.case.object, "noise": format!("{:?}", self.case.family),
            "seed": self.case.seed, "found": errors(&self.errors), "robot": errors(&self.robot),
            "refused": self.found.refused, "prepare_seconds": self.found.prepare,
            "register_seconds": self.found.register, "pair_errors": self.pair_errors,
            "pair_milliseconds":
                self.found.pairs.iter().map(|p| p.milliseconds).collect::<Vec<f64>>(),
            "pairs_accepted": self.found.pairs.iter().map(|p| p.accepted).collect::<Vec<bool>>(),
        })
    }
}
