//! Registered poses of simulated scans: computed here, or read from a file that another program
//! wrote.

use crate::simulated_input::prepare_scans;
use anyhow::{Context, Result, anyhow};
use puffer_core::Progress;
use puffer_core::geometry::{Pose, Vec3, pose_from_rows};
use puffer_core::register::{PairScan, RegisterParams, Status, align_pair, register};
use puffer_core::scan::PreparedScan;
use puffer_core::simulate::SimulatedScans;
use serde::Deserialize;
use std::path::Path;
use std::time::Instant;

/// Registered poses, alignments of pairs, and the times that they took.
pub(super) struct RegistrationOutcome {
    /// `object_from_sensor` of each view.
    pub poses: Vec<Pose>,
    /// Scans that were not accepted; `None` for a program that gives no verdicts.
    pub refused: Option<usize>,
    /// Time of the preparation; `None` for a program that does not state it.
    pub prepare_seconds: Option<f64>,
    pub register_seconds: f64,
    pub pairs: Vec<PairAlignment>,
}

/// The alignment of one scan to the one that was taken nearest to it.
pub(super) struct PairAlignment {
    pub moving: usize,
    pub fixed: usize,
    pub fixed_from_moving: Pose,
    /// Time without preparation, in one thread.
    pub milliseconds: f64,
    /// Whether the program claims success.
    pub accepted: bool,
}

/// The scans prepared for registration, and the time that it took.
pub(super) struct PreparedScans {
    pub scans: Vec<PreparedScan>,
    seconds: f64,
}

impl PreparedScans {
    pub(super) fn new(scans: &SimulatedScans) -> Result<PreparedScans> {
        let started = Instant::now();
        let scans = prepare_scans(scans)?;
        Ok(PreparedScans { scans, seconds: started.elapsed().as_secs_f64() })
    }
}

/// The file that another program writes about a case.
#[derive(Deserialize)]
struct OutcomeFile {
    views: Vec<ViewEntry>,
    seconds: f64,
    pairs: Vec<PairEntry>,
}

#[derive(Deserialize)]
struct ViewEntry {
    object_from_sensor: [[f64; 4]; 4],
}

#[derive(Deserialize)]
struct PairEntry {
    moving: usize,
    fixed: usize,
    fixed_from_moving: [[f64; 4]; 4],
    milliseconds: f64,
    accepted: bool,
}

impl TryFrom<&PairEntry> for PairAlignment {
    type Error = puffer_core::Error;

    fn try_from(entry: &PairEntry) -> puffer_core::Result<PairAlignment> {
        Ok(PairAlignment {
            moving: entry.moving,
            fixed: entry.fixed,
            fixed_from_moving: pose_from_rows(&entry.fixed_from_moving)?,
            milliseconds: entry.milliseconds,
            accepted: entry.accepted,
        })
    }
}

impl RegistrationOutcome {
    /// Registers the scans, all together and in pairs.
    pub(super) fn measure(
        scans: &SimulatedScans,
        prepared: &PreparedScans,
        params: &RegisterParams,
    ) -> Result<RegistrationOutcome> {
        let started = Instant::now();
        let sigma = Some(scans.pose_sigma);
        let priors = robot_poses(scans);
        let found = register(&prepared.scans, &priors, sigma, params, &Progress::silent())?;
        Ok(RegistrationOutcome {
            refused: Some(found.verdicts.iter().filter(|v| v.status != Status::Accepted).count()),
            poses: found.poses,
            prepare_seconds: Some(prepared.seconds),
            register_seconds: started.elapsed().as_secs_f64(),
            pairs: align_pairs(scans, &prepared.scans, params)?,
        })
    }

    /// Reads what another program made of the scans.
    ///
    /// # Errors
    /// A file that cannot be read, or that has another number of poses or poses that are none.
    pub(super) fn read(path: &Path, scans: &SimulatedScans) -> Result<RegistrationOutcome> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read the poses {}", path.display()))?;
        let file: OutcomeFile =
            serde_json::from_str(&text).with_context(|| path.display().to_string())?;
        let count = scans.views.len();
        if file.views.len() != count || file.pairs.iter().any(|p| p.moving.max(p.fixed) >= count) {
            return Err(anyhow!("{} is not about {count} views", path.display()));
        }
        let poses = file.views.iter().map(|view| pose_from_rows(&view.object_from_sensor));
        Ok(RegistrationOutcome {
            poses: poses.collect::<puffer_core::Result<_>>()?,
            refused: None,
            prepare_seconds: None,
            register_seconds: file.seconds,
            pairs: file
                .pairs
                .iter()
                .map(PairAlignment::try_from)
                .collect::<puffer_core::Result<_>>()?,
        })
    }
}

/// The poses that the robot reports.
pub(super) fn robot_poses(scans: &SimulatedScans) -> Vec<Pose> {
    scans.views.iter().map(|v| v.reported_pose).collect()
}

/// Aligns each scan to the one that was taken nearest to it, in one thread.
fn align_pairs(
    scans: &SimulatedScans,
    prepared: &[PreparedScan],
    params: &RegisterParams,
) -> Result<Vec<PairAlignment>> {
    let ready: Vec<PairScan> =
        prepared.iter().map(|scan| PairScan::new(scan, scans.pose_sigma, params)).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(pool.install(|| {
        (0..ready.len()).filter_map(|moving| align_pair_of(scans, &ready, moving, params)).collect()
    }))
}

/// Aligns the scan `moving` to the one that was taken nearest to it; `None` if it is the only one.
fn align_pair_of(
    scans: &SimulatedScans,
    ready: &[PairScan],
    moving: usize,
    params: &RegisterParams,
) -> Option<PairAlignment> {
    let fixed = nearest_view(scans, moving)?;
    let guess = scans.views[fixed].reported_pose.inverse() * scans.views[moving].reported_pose;
    let started = Instant::now();
    let (fixed_from_moving, verdict) =
        align_pair(&ready[moving], &ready[fixed], &guess, scans.pose_sigma, params);
    Some(PairAlignment {
        moving,
        fixed,
        fixed_from_moving,
        milliseconds: started.elapsed().as_secs_f64() * 1e3,
        accepted: verdict.status == Status::Accepted,
    })
}

/// The view that was taken nearest to `view`, by the robot's poses.
fn nearest_view(scans: &SimulatedScans, view: usize) -> Option<usize> {
    let positions: Vec<Vec3> =
        scans.views.iter().map(|v| v.reported_pose.translation.vector).collect();
    (0..positions.len()).filter(|i| *i != view).min_by(|a, b| {
        let [a, b] = [a, b].map(|i| (positions[*i] - positions[view]).norm_squared());
        a.total_cmp(&b)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::geometry::transform;

    const ROWS: [[f64; 4]; 4] =
        [[0.0, -1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0], [0.0, 0.0, 0.0, 1.0]];

    #[test]
    fn a_pair_of_a_file_becomes_an_alignment() {
        let text = serde_json::json!({
            "moving": 2, "fixed": 0, "fixed_from_moving": ROWS, "milliseconds": 12.5, "accepted": true
        });
        let entry: PairEntry = serde_json::from_value(text).unwrap();
        let pair = PairAlignment::try_from(&entry).unwrap();
        assert_eq!((pair.moving, pair.fixed, pair.milliseconds), (2, 0, 12.5));
        let moved = transform(&pair.fixed_from_moving, &Vec3::x());
        assert!((moved - Vec3::new(1.0, 3.0, 3.0)).norm() < 1e-12 && pair.accepted);
    }

    #[test]
    fn rows_that_are_no_pose_are_refused() {
        let mut rows = ROWS;
        rows[0][0] = 3.0;
        let entry = PairEntry {
            moving: 0,
            fixed: 1,
            fixed_from_moving: rows,
            milliseconds: 1.0,
            accepted: false,
        };
        assert!(PairAlignment::try_from(&entry).is_err());
    }
}
