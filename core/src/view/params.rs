//! Parameters of view planning. Wiedemann 2014 states the three weights and the five points a
//! voxel; all other defaults are ours.

use crate::geometry::SensorModel;

crate::choice! {
    /// How the worth of a simulated scan is measured.
    pub enum GainMeasure {
        /// Weighted counts of voxels (Wiedemann 2014).
        Thesis = "thesis",
        /// Entropy of the voxels seen (Kriegel et al. 2012).
        Entropy = "entropy",
        /// Hidden voxels seen and quality by incidence (Massios & Fisher 1998).
        MassiosFisher = "massios_fisher",
        /// Angle to the sum of the normals measured so far (Khalfaoui et al. 2013, Loriot et al.
        /// 2008).
        MassVector = "mass_vector",
        /// Evenly spread directions in random order: a baseline.
        Random = "random",
        /// Directions spread evenly over the sphere: a baseline.
        Sphere = "sphere",
    }
}

crate::choice! {
    /// What the chosen view maximises.
    pub enum Utility {
        /// The gain.
        Gain = "gain",
        /// The gain per second of motion and scan.
        PerSecond = "per_second",
    }
}

crate::params! {
    /// Parameters of the view planner.
    pub struct ViewParams("view") {
        /// Edge of a voxel of the planner; 0 derives it from the spacing of the sensor's rays and
        /// its noise.
        voxel_edge: f64 = 0.0, in [0.0, 0.1], unit "m";
        /// Number of measured points that a surface voxel needs to count as measured.
        min_points: usize = 5, in [1, 10000];
        /// Weight in a view's gain of surface voxels that lack points.
        weight_occupied: f64 = 1.0, in [0.0, 1000.0];
        /// Weight in a view's gain of a surface voxel that lacks points but touches one that has
        /// them, as a share of `weight_occupied`. It is 1 in Wiedemann 2014.
        beside_share: f64 = 0.5, in [0.0, 1.0];
        /// Weight in a view's gain of possible inside and possible border voxels (space hidden
        /// behind surface).
        weight_inside: f64 = 0.5, in [0.0, 1000.0];
        /// Possible inside and border voxels count only within this number of voxels of a surface
        /// voxel. At 0 all count, as in Wiedemann 2014.
        hidden_reach: usize = 3, in [0, 20];
        /// Weight in a view's gain of unknown voxels. It is 0.01 in Wiedemann 2014.
        weight_unknown: f64 = 0.0, in [0.0, 1000.0];
        /// Distance of candidate viewpoints from the surface; 0 takes the sensor's working
        /// distance.
        working_distance: f64 = 0.0, in [0.0, 10.0], unit "m";
        /// Radius, in voxels, of the neighbourhood of a voxel in which possible inside voxels
        /// determine the viewing direction onto it.
        neighbourhood: usize = 3, in [1, 10];
        /// Candidate viewpoints nearer to each other than this share of the working distance are
        /// merged if their viewing directions agree (see `merge_angle`).
        merge_distance: f64 = 0.25, in [0.0, 2.0];
        /// Largest angle between the viewing directions of candidates that are merged.
        merge_angle: f64 = 0.35, in [0.0, 3.15], unit "rad";
        /// Candidates nearer to a view already used than this share of the working distance are
        /// dropped if their viewing directions agree (see `used_angle`).
        used_distance: f64 = 0.1, in [0.0, 2.0];
        /// Largest angle between the viewing directions of a view already used and a candidate that
        /// is dropped for it.
        used_angle: f64 = 0.17, in [0.0, 3.15], unit "rad";
        /// How the worth of a view is measured from its simulated scan.
        measure: GainMeasure = GainMeasure::Thesis;
        /// What the chosen view maximises: its gain, or its gain per second of motion and scan.
        utility: Utility = Utility::Gain;
        /// Time that a scan takes. It is added to the time of the motion where the gain per second
        /// counts.
        scan_time: f64 = 5.0, in [0.1, 1000.0], unit "s";
        /// Smallest share of the rays into the object that must meet known surface at a measurable
        /// incidence, so that the scan can be registered. Views with less are taken only if no
        /// other is left.
        min_overlap: f64 = 0.2, in [0.0, 1.0];
        /// Planning ends when no view gains at least this share of the number of known surface
        /// voxels. At 0 it goes on to the last voxel.
        min_gain: f64 = 0.005, in [0.0, 1.0];
        /// Number of scans that may see a voxel without measuring it before it counts as not
        /// measurable.
        max_tries: usize = 3, in [1, 100];
        /// A voxel counts as surface while the scans that saw through it are at most this many for
        /// each scan that hit it.
        hit_weight: f64 = 2.0, in [0.1, 100.0];
        /// Points are left out as outliers if fewer than this number of points of the same scan lie
        /// in their voxel and those that touch it.
        min_support: usize = 3, in [1, 1000];
        /// Seed of the random order of views with the measure `random`.
        seed: usize = 1, in [0, 1000000000];
    }
}

/// Typical error of stereo matching, pixels.
const DISPARITY_SIGMA_PX: f64 = 0.5;
/// A voxel spans this many distances between measurements, so that one scan from the front gives it
/// its points even where the surface only cuts its corner, and this many standard deviations, so
/// that noise stays in two layers of voxels.
const EDGE_RATIO: f64 = 4.0;
/// Finer voxels than this would plan views for details that registration blurs, metres.
const MIN_EDGE_M: f64 = 4e-3;

/// Distance between the sensor's rays at its working distance, metres: the larger of its two
/// directions.
pub(crate) fn ray_spacing(sensor: &SensorModel) -> f64 {
    match sensor {
        SensorModel::Stereo(s) => {
            let pixels = s.image[0] / s.grid[0] as f64;
            s.working_distance * pixels / s.focal_length()
        }
        SensorModel::Striper(s) => s.point_spacing.max(s.profile_spacing),
    }
}

impl ViewParams {
    /// The edge of a voxel for `sensor`, metres.
    pub fn edge(&self, sensor: &SensorModel) -> f64 {
        if self.voxel_edge > 0.0 {
            return self.voxel_edge;
        }
        let sigma = match sensor {
            SensorModel::Stereo(s) => {
                s.working_distance.powi(2) / (s.focal_length() * s.baseline) * DISPARITY_SIGMA_PX
            }
            SensorModel::Striper(_) => 0.0,
        };
        (EDGE_RATIO * ray_spacing(sensor).max(sigma)).max(MIN_EDGE_M)
    }

    /// Distance of viewpoints from the surface for `sensor`, metres.
    pub fn distance(&self, sensor: &SensorModel) -> f64 {
        if self.working_distance > 0.0 { self.working_distance } else { sensor.working_distance() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{StereoModel, StriperModel};

    #[test]
    fn voxels_follow_the_spacing_and_the_noise_of_the_sensor() {
        let params = ViewParams::default();
        let coarse = StriperModel {
            point_spacing: 0.5e-3,
            profile_spacing: 2e-3,
            ..StriperModel::SCANCONTROL
        };
        assert!((params.edge(&SensorModel::Striper(coarse)) - 8e-3).abs() < 1e-12);
        let fine = StriperModel { profile_spacing: 0.5e-3, ..coarse };
        assert_eq!(params.edge(&SensorModel::Striper(fine)), MIN_EDGE_M);
        // Depth noise of half a pixel of disparity: z^2 / (f b) / 2.
        let stereo = StereoModel { baseline: 0.01, ..StereoModel::GUPPY };
        let noise = stereo.working_distance.powi(2) / (stereo.focal_length() * 0.01) / 2.0;
        let spacing = ray_spacing(&SensorModel::Stereo(stereo));
        assert!(noise > spacing, "{noise} {spacing}");
        assert!((params.edge(&SensorModel::Stereo(stereo)) - 4.0 * noise).abs() < 1e-12);
        let fixed = ViewParams { voxel_edge: 0.007, working_distance: 0.4, ..params };
        assert_eq!(fixed.edge(&SensorModel::Stereo(stereo)), 0.007);
        assert_eq!(fixed.distance(&SensorModel::Stereo(stereo)), 0.4);
    }
}
