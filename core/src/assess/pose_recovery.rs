//! Recovery of known poses: scans are moved away from their poses and registered again. This is how
//! registration is tested on scans of a real sensor, which have no other truth.

use super::perturbation::{PoseDifference, perturb_pose, pose_differences};
use crate::geometry::{Pose, Vec3};
use crate::register::{RegisterParams, Registration, register};
use crate::scan::{PoseSigma, PreparedScan};
use crate::scan_files::ScanSet;
use crate::{Error, Progress, Result};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Scans with reference poses, to which perturbed scans should return.
pub struct RecoveryTest {
    scans: Vec<PreparedScan>,
    poses: Vec<Pose>,
    /// Some points of each scan, sensor frame, metres.
    points: Vec<Vec<Vec3>>,
    /// Centroid of these points of each scan.
    centroids: Vec<Vec3>,
}

/// The result of one perturbed scan.
#[derive(Clone, Debug)]
pub struct RecoveredPose {
    /// Difference from the reference pose after one common rigid fit of all accepted scans.
    pub difference: PoseDifference,
    /// Whether registration accepted the scan.
    pub accepted: bool,
    /// The reason that the verdict states.
    pub reason: String,
}

/// Limit of the points of a scan that centroids and the common fit use.
const MAX_POINTS_PER_SCAN: usize = 2000;

impl RecoveryTest {
    /// Prepares the scans of `set`, whose poses become the reference.
    ///
    /// # Errors
    /// As [`PreparedScan::new`].
    pub fn new(set: &ScanSet) -> Result<RecoveryTest> {
        let scans: Vec<PreparedScan> =
            set.views.iter().map(|v| PreparedScan::new(&v.scan)).collect::<Result<_>>()?;
        let points: Vec<Vec<Vec3>> = scans
            .iter()
            .map(|s| s.sample(MAX_POINTS_PER_SCAN).into_iter().map(|i| s.points[i]).collect())
            .collect();
        let centroids = points.iter().map(|p| p.iter().sum::<Vec3>() / p.len().max(1) as f64);
        Ok(RecoveryTest {
            centroids: centroids.collect(),
            poses: set.views.iter().map(|v| v.object_from_sensor).collect(),
            scans,
            points,
        })
    }

    /// Perturbs all scans and registers them together.
    ///
    /// Every scan is rotated by exactly `angle` (radians) about the centroid of its points and
    /// moved by exactly `distance` (metres), in directions drawn with `seed`. Registration is told
    /// the standard deviations of such perturbations: a third of their squares is the variance of
    /// each axis. The translation includes how far the rotation about the centroid moves the sensor
    /// frame's origin.
    ///
    /// # Errors
    /// As [`register`].
    pub fn perturb_and_register(
        &self,
        angle: f64,
        distance: f64,
        seed: u64,
        params: &RegisterParams,
        progress: &Progress,
    ) -> Result<Vec<RecoveredPose>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let given: Vec<Pose> = self
            .poses
            .iter()
            .zip(&self.centroids)
            .map(|(pose, centroid)| perturb_pose(pose, centroid, angle, distance, &mut rng))
            .collect();
        let squared_lever = self.centroids.iter().map(Vec3::norm_squared).sum::<f64>()
            / self.centroids.len().max(1) as f64;
        // A vector of length l in a random direction has the variance l^2 / 3 along each axis.
        let root_of_axes = 3.0_f64.sqrt();
        let sigma = PoseSigma {
            translation: distance.hypot(angle * squared_lever.sqrt()) / root_of_axes,
            rotation: angle / root_of_axes,
        };
        let found = register(&self.scans, &given, Some(sigma), params, progress)?;
        self.compare(&found)
    }

    /// Compares registered poses with the reference.
    fn compare(&self, found: &Registration) -> Result<Vec<RecoveredPose>> {
        let accepted: Vec<bool> = found.verdicts.iter().map(|v| v.is_accepted()).collect();
        // Scans that were not accepted do not take part in the common fit.
        let points: Vec<Vec<Vec3>> = self
            .points
            .iter()
            .zip(&accepted)
            .map(|(p, &yes)| if yes { p.clone() } else { Vec::new() })
            .collect();
        let differences = pose_differences(&found.poses, &self.poses, &points)
            .ok_or_else(|| Error::input("no scan was accepted: there is nothing to compare"))?;
        let scans = differences.into_iter().zip(accepted).zip(&found.verdicts);
        let recovered = scans.map(|((difference, accepted), verdict)| RecoveredPose {
            difference,
            accepted,
            reason: verdict.reason.clone(),
        });
        Ok(recovered.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mat6;
    use crate::register::{Status, Verdict};

    /// A test on two scans without clouds: only their points and poses count for the comparison.
    fn two_scans() -> RecoveryTest {
        let points: Vec<Vec3> =
            (0..20).map(|i| Vec3::new(f64::from(i % 5), f64::from(i / 5), 0.5) * 0.01).collect();
        let centroid = points.iter().sum::<Vec3>() / 20.0;
        RecoveryTest {
            scans: Vec::new(),
            poses: vec![Pose::identity(), Pose::translation(0.1, 0.0, 0.0)],
            points: vec![points.clone(), points],
            centroids: vec![centroid; 2],
        }
    }

    fn registration(poses: Vec<Pose>, statuses: [Status; 2]) -> Registration {
        let verdicts = statuses.map(|status| Verdict {
            status,
            reason: String::new(),
            fitness: 1.0,
            overlap: 1.0,
            rmse: 0.0,
            correspondences: 0,
            covariance: Mat6::zeros(),
            free_directions: Vec::new(),
        });
        let pose_sigma = PoseSigma { translation: 0.001, rotation: 0.001 };
        Registration { poses, verdicts: verdicts.into(), pose_sigma, residual: None }
    }

    #[test]
    fn a_common_motion_of_all_scans_is_no_difference() {
        let test = two_scans();
        let motion = Pose::rotation(Vec3::new(0.1, 0.2, -0.3)) * Pose::translation(0.3, 0.2, 0.1);
        let poses = test.poses.iter().map(|pose| motion * pose).collect();
        let found = test.compare(&registration(poses, [Status::Accepted; 2])).unwrap();
        for scan in found {
            assert!(scan.accepted);
            assert!(scan.difference.angle < 1e-6 && scan.difference.distance < 1e-9);
        }
    }

    #[test]
    fn a_refused_scan_does_not_take_part_in_the_fit() {
        let test = two_scans();
        let poses = vec![test.poses[0], test.poses[1] * Pose::translation(0.0, 0.0, 0.02)];
        let statuses = [Status::Accepted, Status::Refused];
        let found = test.compare(&registration(poses.clone(), statuses)).unwrap();
        assert!(found[0].difference.distance < 1e-9);
        assert!(!found[1].accepted);
        assert!((found[1].difference.distance - 0.02).abs() < 1e-9);
        assert!(test.compare(&registration(poses, [Status::Refused; 2])).is_err());
    }
}
