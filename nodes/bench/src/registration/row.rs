//! The figures of a case, and how they are printed.

use super::case::RegistrationCase;
use super::outcome::{RegistrationOutcome, robot_poses};
use anyhow::Result;
use puffer_core::Progress;
use puffer_core::assess::{PoseErrors, PosedHits, pair_error, pose_errors, quantile};
use puffer_core::geometry::{Pose, Vec3};
use puffer_core::mesh::Mesh;
use puffer_core::simulate::SimulatedScans;
use serde_json::{Value, json};

/// Limit of the hits of a case that are compared; more change no figure by a per cent.
const MAX_HITS: usize = 60_000;

/// A pair with a larger error has failed.
const MAX_PAIR_ERROR_MM: f64 = 5.0;

/// The figures of one case.
pub(super) struct RegistrationRow {
    case: RegistrationCase,
    outcome: RegistrationOutcome,
    /// Errors of the poses that the robot reports.
    robot_errors: PoseErrors,
    /// Errors of the registered poses.
    errors: PoseErrors,
    /// Error of the alignment of each pair, mm (`puffer_core::assess::pair_error`).
    pair_errors: Vec<f64>,
}

/// A subsample of the hits of all views, with the estimates `poses`.
fn pose_hits(scans: &SimulatedScans, poses: &[Pose]) -> Vec<PosedHits> {
    let all: usize = scans.views.iter().map(|v| v.scan.returns().count()).sum();
    let step = all.div_ceil(MAX_HITS).max(1);
    let views = scans.views.iter().zip(poses);
    let posed = views.map(|(view, pose)| {
        let hits = view.hits.iter().filter(|h| h[0].is_finite()).step_by(step);
        PosedHits {
            hits: hits.map(|h| Vec3::from(h.map(f64::from))).collect(),
            truth: view.true_pose,
            estimate: *pose,
        }
    });
    posed.collect()
}

/// The heading of a table of cases.
pub(super) fn heading() -> String {
    "errors in mm: along the normal, full, of the surface; in brackets the robot's own\n".to_owned()
}

/// The heading of a table of variants of `case`.
pub(super) fn variants_heading(case: &RegistrationCase) -> String {
    format!(
        "{}: errors of all scans in mm, time in s; pairs: median error in mm, share beyond {MAX_PAIR_ERROR_MM} mm in %, time in ms\n  \
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

/// Errors of registered poses, in brackets those of the robot.
fn format_errors(found: &PoseErrors, robot: &PoseErrors) -> String {
    format!(
        "normal {:6.3} ({:5.2})  full {:6.3} ({:5.2})  surface {:6.3} ({:5.2})",
        found.normal, robot.normal, found.full, robot.full, found.surface, robot.surface
    )
}

/// The line of the worst figures of several seeds.
pub(super) fn worst_row(rows: &[RegistrationRow]) -> String {
    let refused = rows.iter().filter_map(|r| r.outcome.refused).max();
    format!(
        "{:<12} {:<4} worst  {}  {}\n",
        rows[0].case.object,
        format!("{:?}", rows[0].case.family),
        format_errors(
            &largest_errors(rows.iter().map(|r| &r.errors)),
            &largest_errors(rows.iter().map(|r| &r.robot_errors))
        ),
        refusals(refused).trim_end()
    )
}

/// The largest of each figure.
fn largest_errors<'a>(errors: impl Iterator<Item = &'a PoseErrors>) -> PoseErrors {
    errors.fold(PoseErrors { normal: 0.0, full: 0.0, surface: 0.0 }, |worst, e| PoseErrors {
        normal: worst.normal.max(e.normal),
        full: worst.full.max(e.full),
        surface: worst.surface.max(e.surface),
    })
}

/// Number of refused scans in words; empty for a program that gives no verdicts.
fn refusals(refused: Option<usize>) -> String {
    refused.map(|count| format!("refused {count}  ")).unwrap_or_default()
}

impl RegistrationRow {
    /// Measures the poses of `outcome` against the truth.
    pub(super) fn measure(
        case: RegistrationCase,
        truth: &Mesh,
        scans: &SimulatedScans,
        outcome: RegistrationOutcome,
    ) -> Result<RegistrationRow> {
        let posed_hits = pose_hits(scans, &outcome.poses);
        let reported_hits = pose_hits(scans, &robot_poses(scans));
        Ok(RegistrationRow {
            robot_errors: pose_errors(&reported_hits, truth, &Progress::silent())?,
            pair_errors: outcome
                .pairs
                .iter()
                .map(|p| {
                    pair_error(&posed_hits[p.moving], &posed_hits[p.fixed], &p.fixed_from_moving)
                })
                .collect(),
            errors: pose_errors(&posed_hits, truth, &Progress::silent())?,
            case,
            outcome,
        })
    }

    /// The line of the case in a table of cases, and one about its pairs.
    pub(super) fn line(&self) -> String {
        format!(
            "{:<12} {:<4} {:>5}  {}  {}{}register {:.1} s\n",
            self.case.object,
            format!("{:?}", self.case.family),
            self.case.seed,
            format_errors(&self.errors, &self.robot_errors),
            refusals(self.outcome.refused),
            self.outcome.prepare_seconds.map(|s| format!("prepare {s:.1} s, ")).unwrap_or_default(),
            self.outcome.register_seconds
        ) + &self.pairs_line()
    }

    fn pairs_line(&self) -> String {
        let times: Vec<f64> = self.outcome.pairs.iter().map(|p| p.milliseconds).collect();
        format!(
            "{:24}pairs: error median {:.3}, 90 % {:.3}; {} of {} said to succeed, {} of these beyond {MAX_PAIR_ERROR_MM} mm; \
             median {:.1} ms\n",
            "",
            quantile(&self.pair_errors, 0.5),
            quantile(&self.pair_errors, 0.9),
            self.outcome.pairs.iter().filter(|p| p.accepted).count(),
            times.len(),
            self.false_successes(),
            quantile(&times, 0.5)
        )
    }

    /// Pairs that the program claims as successes although they failed.
    fn false_successes(&self) -> usize {
        let pairs = self.outcome.pairs.iter().zip(&self.pair_errors);
        pairs.filter(|(pair, error)| pair.accepted && **error > MAX_PAIR_ERROR_MM).count()
    }

    /// The row of a table of variants of this case.
    pub(super) fn variant_line(&self, variant: &str) -> String {
        let times: Vec<f64> = self.outcome.pairs.iter().map(|p| p.milliseconds).collect();
        let failed = self.pair_errors.iter().filter(|error| **error > MAX_PAIR_ERROR_MM).count();
        format!(
            "  {variant:<24} {:>8.3} {:>8.3} {:>8.3} {:>8} {:>7.1} {:>8.3} {:>7.1} {:>7.1}\n",
            self.errors.normal,
            self.errors.full,
            self.errors.surface,
            self.outcome.refused.map_or_else(|| "-".to_owned(), |count| count.to_string()),
            self.outcome.register_seconds,
            quantile(&self.pair_errors, 0.5),
            100.0 * failed as f64 / self.pair_errors.len().max(1) as f64,
            quantile(&times, 0.5)
        )
    }

    pub(super) fn json(&self) -> Value {
        json!({
            "object": self.case.object, "noise": format!("{:?}", self.case.family),
            "seed": self.case.seed, "found": errors_json(&self.errors), "robot": errors_json(&self.robot_errors),
            "refused": self.outcome.refused, "prepare_seconds": self.outcome.prepare_seconds,
            "register_seconds": self.outcome.register_seconds, "pair_errors": self.pair_errors,
            "pair_milliseconds":
                self.outcome.pairs.iter().map(|p| p.milliseconds).collect::<Vec<f64>>(),
            "pairs_accepted": self.outcome.pairs.iter().map(|p| p.accepted).collect::<Vec<bool>>(),
        })
    }
}

fn errors_json(errors: &PoseErrors) -> Value {
    json!({ "normal": errors.normal, "full": errors.full, "surface": errors.surface })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::outcome::PairAlignment;
    use puffer_core::simulate::NoiseFamily;

    fn row(seed: u64, normal: f64, refused: Option<usize>) -> RegistrationRow {
        let pairs = [true, true, false].map(|accepted| PairAlignment {
            moving: 0,
            fixed: 1,
            fixed_from_moving: Pose::identity(),
            milliseconds: 10.0,
            accepted,
        });
        RegistrationRow {
            case: RegistrationCase { object: "mug".into(), family: NoiseFamily::P3, seed },
            outcome: RegistrationOutcome {
                poses: Vec::new(),
                refused,
                prepare_seconds: None,
                register_seconds: 2.5,
                pairs: pairs.into(),
            },
            robot_errors: PoseErrors { normal: 3.0, full: 4.0, surface: 2.0 },
            errors: PoseErrors { normal, full: 1.0 - normal, surface: 0.1 },
            pair_errors: vec![1.0, 7.0, 8.0],
        }
    }

    #[test]
    fn accepted_pairs_with_a_large_error_are_false_successes() {
        let row = row(1, 0.3, None);
        assert_eq!(row.false_successes(), 1);
        assert!(row.pairs_line().contains("2 of 3 said to succeed, 1 of these beyond 5 mm"));
        assert!(!row.line().contains("refused") && row.line().contains("register 2.5 s"));
    }

    #[test]
    fn the_worst_row_takes_each_figure_by_itself() {
        let text = worst_row(&[row(1, 0.3, Some(2)), row(2, 0.6, Some(1))]);
        assert_eq!(
            text,
            "mug          P3   worst  normal  0.600 ( 3.00)  full  0.700 ( 4.00)  surface  0.100 ( 2.00)  refused 2\n"
        );
    }

    #[test]
    fn the_json_names_the_errors_of_poses_and_pairs() {
        let json = row(1, 0.25, Some(0)).json();
        assert_eq!(json["found"]["normal"], 0.25);
        assert_eq!(json["robot"]["full"], 4.0);
        assert_eq!(json["pair_errors"], json!([1.0, 7.0, 8.0]));
        assert_eq!(json["pairs_accepted"], json!([true, true, false]));
    }
}
