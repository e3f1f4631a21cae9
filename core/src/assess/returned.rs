//! Whether perturbed scans come back to the poses that they had: scans of a real sensor have no other truth.

use super::perturb::{differences, perturbed};
use crate::geometry::{Pose, Vec3};
use crate::register::{PreparedScan, RegisterParams, Registration, Status, register};
use crate::scans::{PoseSigma, ScanSet};
use crate::{Error, Progress, Result};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Scans and their reference poses.
pub struct PosedReference {
    scans: Vec<PreparedScan>,
    poses: Vec<Pose>,
    /// Some points of each scan, sensor frame, metres, and their mean.
    points: Vec<Vec<Vec3>>,
    centers: Vec<Vec3>,
}

/// What became of one scan.
#[derive(Clone, Debug)]
pub struct Returned {
    /// Angle (radians) and distance (metres) from the reference pose, after one common rigid fit of all scans accepted.
    pub difference: (f64, f64),
    /// Whether it was accepted.
    pub accepted: bool,
    /// The verdict's reason.
    pub reason: String,
}

/// Points of a scan whose mean and common fit are looked at.
const POINTS: usize = 2000;

impl PosedReference {
    /// The scans of `set` with its poses as reference.
    ///
    /// # Errors
    /// As [`PreparedScan::new`].
    pub fn new(set: &ScanSet) -> Result<PosedReference> {
        let scans: Vec<PreparedScan> =
            set.views.iter().map(|v| PreparedScan::new(&v.scan)).collect::<Result<_>>()?;
        let points: Vec<Vec<Vec3>> = scans
            .iter()
            .map(|s| s.sample(POINTS).into_iter().map(|i| s.points[i]).collect())
            .collect();
        let mean = |p: &Vec<Vec3>| p.iter().sum::<Vec3>() / p.len().max(1) as f64;
        Ok(PosedReference {
            centers: points.iter().map(mean).collect(),
            poses: set.views.iter().map(|v| v.object_from_sensor).collect(),
            scans,
            points,
        })
    }

    /// Turns every scan by exactly `angle` (radians) about its points' middle, moves it by exactly `distance` (metres),
    /// in directions that come from `seed`, and registers all together. The pose sigma stated is what goes with these
    /// sizes: a third of their squares for each axis; a turn about points that lie off the sensor frame's
    /// origin moves that.
    ///
    /// # Errors
    /// As [`register`].
    pub fn attempt(
        &self,
        angle: f64,
        distance: f64,
        seed: u64,
        params: &RegisterParams,
        progress: &Progress,
    ) -> Result<Vec<Returned>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let given: Vec<Pose> = self
            .poses
            .iter()
            .zip(&self.centers)
            .map(|(pose, center)| perturbed(pose, center, angle, distance, &mut rng))
            .collect();
        let lever = self.centers.iter().map(Vec3::norm_squared).sum::<f64>()
            / self.centers.len().max(1) as f64;
        let per_axis = 3.0_f64.sqrt();
        let sigma = PoseSigma {
            translation: distance.hypot(angle * lever.sqrt()) / per_axis,
            rotation: angle / per_axis,
        };
        let found = register(&self.scans, &given, Some(sigma), params, progress)?;
        self.compare(&found)
    }

    fn compare(&self, found: &Registration) -> Result<Vec<Returned>> {
        let accepted: Vec<bool> =
            found.verdicts.iter().map(|v| v.status == Status::Accepted).collect();
        // Refused scans have no say in the common fit.
        let points: Vec<Vec<Vec3>> = self
            .points
            .iter()
            .zip(&accepted)
            .map(|(p, &yes)| if yes { p.clone() } else { Vec::new() })
            .collect();
        let differences = differences(&found.poses, &self.poses, &points)
            .ok_or_else(|| Error::input("no scan was accepted: there is nothing to compare"))?;
        let one =
            |((difference, accepted), verdict): (((f64, f64), bool), &crate::register::Verdict)| {
                Returned { difference, accepted, reason: verdict.reason.clone() }
            };
        Ok(differences.into_iter().zip(accepted).zip(&found.verdicts).map(one).collect())
    }
}
