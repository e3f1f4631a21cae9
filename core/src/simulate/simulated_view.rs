//! The result of a simulation.

use super::noise_family::NoiseFamily;
use crate::geometry::{Pose, Scan};
use crate::scan::PoseSigma;

/// One simulated scan. All vectors are as long as `scan.points`. A point without a return is NaN
/// and has the label [`GOOD_LABEL`](super::GOOD_LABEL).
#[derive(Clone, Debug)]
pub struct SimulatedView {
    /// What the sensor delivers, sensor frame.
    pub scan: Scan,
    /// The pose `object_from_sensor` that the robot reports.
    pub reported_pose: Pose,
    /// The true pose `object_from_sensor`.
    pub true_pose: Pose,
    /// The label of each point: [`GOOD_LABEL`](super::GOOD_LABEL),
    /// [`OUTLIER_LABEL`](super::OUTLIER_LABEL), [`FLYING_LABEL`](super::FLYING_LABEL) or
    /// [`SURROUNDINGS_LABEL`](super::SURROUNDINGS_LABEL).
    pub labels: Vec<u8>,
    /// Where each ray truly met the object or its surroundings, true sensor frame, metres.
    pub hits: Vec<[f32; 3]>,
}

/// All scans of a simulation.
#[derive(Clone, Debug)]
pub struct SimulatedScans {
    /// The noise family that made them.
    pub family: NoiseFamily,
    /// The views in the order of their numbers.
    pub views: Vec<SimulatedView>,
    /// The standard deviation of its poses that the robot states.
    pub pose_sigma: PoseSigma,
}
