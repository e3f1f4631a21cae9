//! The outcome of a registration.

use super::joint::rms_residual;
use super::judge::Verdict;
use super::params::RegisterParams;
use super::registration_scan::RegistrationScan;
use super::strategy::Strategy;
use crate::geometry::Pose;
use crate::scan::{PoseSigma, PreparedScan};

/// The registered scans: one entry a view in each list.
#[derive(Clone, Debug)]
pub struct Registration {
    /// Estimated `object_from_sensor`.
    pub poses: Vec<Pose>,
    /// What became of each scan.
    pub verdicts: Vec<Verdict>,
    /// Standard deviation of the given poses that was used.
    pub pose_sigma: PoseSigma,
    /// Root mean square point-to-plane distance between overlapping scans, metres; none if no two
    /// scans overlap.
    pub residual: Option<f64>,
}

impl Registration {
    /// The registration of scans whose poses `object_from_sensor` are known exactly.
    pub fn exact(scans: &[PreparedScan], poses: &[Pose]) -> Registration {
        let pose_sigma = PoseSigma { translation: 0.0, rotation: 0.0 };
        let verdict = Verdict {
            reason: "pose given as exact".into(),
            ..Verdict::first(&pose_sigma.information())
        };
        let verdicts = vec![Verdict { free_directions: Vec::new(), ..verdict }; poses.len()];
        let mut registration =
            Registration { poses: poses.to_vec(), verdicts, pose_sigma, residual: None };
        let strategy = Strategy::new(&RegisterParams::default());
        let scans: Vec<RegistrationScan> =
            scans.iter().map(|scan| RegistrationScan::new(scan, pose_sigma, &strategy)).collect();
        registration.update_residual(&scans.iter().collect::<Vec<_>>(), &strategy.params);
        registration
    }

    /// Indices of the accepted scans, ascending.
    pub(crate) fn accepted(&self) -> Vec<usize> {
        (0..self.verdicts.len()).filter(|&i| self.verdicts[i].is_accepted()).collect()
    }

    /// Sets the residual to that of the accepted scans.
    pub(crate) fn update_residual(&mut self, scans: &[&RegistrationScan], params: &RegisterParams) {
        let accepted = self.accepted();
        let scans: Vec<&RegistrationScan> = accepted.iter().map(|&i| scans[i]).collect();
        let poses: Vec<Pose> = accepted.iter().map(|&i| self.poses[i]).collect();
        self.residual = rms_residual(&scans, &poses, params);
    }
}
