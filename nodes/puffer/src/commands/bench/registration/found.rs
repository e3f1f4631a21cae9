//! Poses of simulated scans: ours, or those that another program wrote.

use crate::commands::bench::prepared;
use anyhow::{Context, Result, anyhow};
use puffer_core::Progress;
use puffer_core::geometry::{Pose, pose_from_rows};
use puffer_core::register::{PairScan, PreparedScan, RegisterParams, Status, align_pair, register};
use puffer_core::simulate::SimulatedScans;
use serde::Deserialize;
use std::path::Path;
use std::time::Instant;

/// Poses `object_from_sensor`, the alignments of pairs, and the seconds that they took.
pub(super) struct Found {
    pub poses: Vec<Pose>,
    /// Scans that are not accepted; none for a program that gives no verdicts.
    pub refused: Option<usize>,
    pub prepare: Option<f64>,
    pub register: f64,
    pub pairs: Vec<Pair>,
}

/// One scan aligned to the one that was taken nearest to it.
pub(super) struct Pair {
    pub moving: usize,
    pub fixed: usize,
    pub fixed_from_moving: Pose,
    /// After preparation, in one thread.
    pub milliseconds: f64,
    /// Whether the program says that it succeeded.
    pub accepted: bool,
}

/// The scans made ready for registration, and the seconds that it took.
pub(super) struct Prepared {
    pub scans: Vec<PreparedScan>,
    seconds: f64,
}

impl Prepared {
    pub(super) fn new(scans: &SimulatedScans) -> Result<Prepared> {
        let started = Instant::now();
        let scans = prepared(scans)?;
        Ok(Prepared { scans, seconds: started.elapsed().as_secs_f64() })
    }
}

#[derive(Deserialize)]
struct Foreign {
    views: Vec<ForeignView>,
    seconds: f64,
    pairs: Vec<ForeignPair>,
}

#[derive(Deserialize)]
struct ForeignView {
    object_from_sensor: [[f64; 4]; 4],
}

#[derive(Deserialize)]
struct ForeignPair {
    moving: usize,
    fixed: usize,
    fixed_from_moving: [[f64; 4]; 4],
    milliseconds: f64,
    accepted: bool,
}

impl Found {
    /// What we make of the scans.
    pub(super) fn ours(
        scans: &SimulatedScans,
        prepared: &Prepared,
        params: &RegisterParams,
    ) -> Result<Found> {
        let started = Instant::now();
        let sigma = Some(scans.pose_sigma);
        let found =
            register(&prepared.scans, &reported(scans), sigma, params, &Progress::silent())?;
        Ok(Found {
            refused: Some(found.verdicts.iter().filter(|v| v.status != Status::Accepted).count()),
            poses: found.poses,
            prepare: Some(prepared.seconds),
            register: started.elapsed().as_secs_f64(),
            pairs: pairs(scans, &prepared.scans, params)?,
        })
    }

    /// What another program wrote.
    ///
    /// # Errors
    /// A file that cannot be read, or that holds another number of poses or no poses at all.
    pub(super) fn foreign(path: &Path, scans: &SimulatedScans) -> Result<Found> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read the poses {}", path.display()))?;
        let written: Foreign =
            serde_json::from_str(&text).with_context(|| path.display().to_string())?;
        let count = scans.views.len();
        if written.views.len() != count
            || written.pairs.iter().any(|p| p.moving.max(p.fixed) >= count)
        {
            return Err(anyhow!("{} is not about {count} views", path.display()));
        }
        let pair = |p: &ForeignPair| -> puffer_core::Result<Pair> {
            Ok(Pair {
                moving: p.moving,
                fixed: p.fixed,
                fixed_from_moving: pose_from_rows(&p.fixed_from_moving)?,
                milliseconds: p.milliseconds,
                accepted: p.accepted,
            })
        };
        let pose = |view: &ForeignView| pose_from_rows(&view.object_from_sensor);
        Ok(Found {
            poses: written.views.iter().map(pose).collect::<puffer_core::Result<_>>()?,
            refused: None,
            prepare: None,
            register: written.seconds,
            pairs: written.pairs.iter().map(pair).collect::<puffer_core::Result<_>>()?,
        })
    }
}

/// The robot's poses.
pub(super) fn reported(scans: &SimulatedScans) -> Vec<Pose> {
    scans.views.iter().map(|v| v.reported_pose).collect()
}

/// Aligns each scan to the one that was taken nearest to it.
fn pairs(
    scans: &SimulatedScans,
    prepared: &[PreparedScan],
    params: &RegisterParams,
) -> Result<Vec<Pair>> {
    let ready: Vec<PairScan> =
        prepared.iter().map(|scan| PairScan::new(scan, scans.pose_sigma, params)).collect();
    let align = |moving: usize| {
        let fixed = neighbour(scans, moving)?;
        let pose = |i: usize| scans.views[i].reported_pose;
        let guess = pose(fixed).inverse() * pose(moving);
        let started = Instant::now();
        let (fixed_from_moving, verdict) =
            align_pair(&ready[moving], &ready[fixed], &guess, scans.pose_sigma, params);
        Some(Pair {
            moving,
            fixed,
            fixed_from_moving,
            milliseconds: started.elapsed().as_secs_f64() * 1e3,
            accepted: verdict.status == Status::Accepted,
        })
    };
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(one.install(|| (0..prepared.len()).filter_map(align).collect()))
}

/// The view that was taken nearest to `view`, by the robot's poses.
fn neighbour(scans: &SimulatedScans, view: usize) -> Option<usize> {
    let at = |i: usize| scans.views[i].reported_pose.translation.vector;
    let distance = |i: &usize| (at(*i) - at(view)).norm_squared();
    (0..scans.views.len()).filter(|i| *i != view).min_by(|a, b| distance(a).total_cmp(&distance(b)))
}
