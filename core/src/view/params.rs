//! Parameters of view planning. Wiedemann 2014 states the three weights and the five points a voxel; all other
//! defaults are ours.

use crate::geometry::SensorModel;

crate::choice! {
    /// What a simulated scan is worth.
    pub enum Measure {
        /// Weighted counts of voxels (Wiedemann 2014).
        Thesis = "thesis",
        /// Entropy of the voxels seen (Kriegel).
        Entropy = "entropy",
        /// Hidden voxels seen and quality by incidence (Massios & Fisher).
        MassiosFisher = "massios_fisher",
        /// Angle to the sum of the normals measured so far (Khalfaoui, Loriot).
        MassVector = "mass_vector",
        /// Any direction, by chance: a baseline.
        Random = "random",
        /// Directions spread evenly over the sphere: a baseline.
        Sphere = "sphere",
    }
}

crate::choice! {
    /// What the chosen view has most of.
    pub enum Utility {
        /// Gain.
        Gain = "gain",
        /// Gain per second of motion and scan.
        PerSecond = "per_second",
    }
}

crate::params! {
    /// Parameters of the view planner.
    pub struct ViewParams("view") {
        /// Edge of a voxel; 0 takes it from the sensor's spacing and noise.
        voxel_edge: f64 = 0.0, in [0.0, 0.1], unit "m";
        /// Measured points that a surface voxel needs.
        min_points: usize = 5, in [1, 10000];
        /// Weight of surface voxels that lack points.
        weight_occupied: f64 = 1.0, in [0.0, 1000.0];
        /// What a surface voxel that lacks points counts for beside one that has them, as a share of `weight_occupied`; 1
        /// in the thesis.
        beside_share: f64 = 0.5, in [0.0, 1.0];
        /// Weight of possible inside and possible border voxels.
        weight_inside: f64 = 0.5, in [0.0, 1000.0];
        /// Possible inside and border voxels count within so many voxels of a surface voxel; 0: all, as in the thesis.
        hidden_reach: usize = 3, in [0, 20];
        /// Weight of unknown voxels; 0.01 in the thesis.
        weight_unknown: f64 = 0.0, in [0.0, 1000.0];
        /// Distance of viewpoints from the surface; 0 takes the sensor's working distance.
        working_distance: f64 = 0.0, in [0.0, 10.0], unit "m";
        /// Radius in voxels within which possible inside voxels give a candidate its direction.
        neighbourhood: usize = 3, in [1, 10];
        /// Candidates within this share of the working distance are merged.
        merge_distance: f64 = 0.25, in [0.0, 2.0];
        /// Candidates are merged if their viewing directions differ by less.
        merge_angle: f64 = 0.35, in [0.0, 3.15], unit "rad";
        /// Candidates within this share of the working distance of a view already used are dropped.
        used_distance: f64 = 0.1, in [0.0, 2.0];
        /// And only if their viewing directions differ by less.
        used_angle: f64 = 0.17, in [0.0, 3.15], unit "rad";
        /// What a view is worth.
        measure: Measure = Measure::Thesis;
        /// What the chosen view has most of.
        utility: Utility = Utility::Gain;
        /// Time of a scan, added to that of the motion where gain per second counts.
        scan_time: f64 = 5.0, in [0.1, 1000.0], unit "s";
        /// Share of the rays into the object that must meet known surface as a sensor measures it, for registration.
        min_overlap: f64 = 0.2, in [0.0, 1.0];
        /// Planning ends when no view gains this share of the known surface voxels; 0 wants the last one.
        min_gain: f64 = 0.005, in [0.0, 1.0];
        /// Scans that look at a voxel in vain before it counts as not measurable.
        max_tries: usize = 3, in [1, 100];
        /// Scans that must see through a voxel for each that hit it, before it is no surface.
        hit_weight: f64 = 2.0, in [0.1, 100.0];
        /// Points with fewer of the same scan in their voxel and those around it are outliers and left out.
        min_support: usize = 3, in [1, 1000];
        /// Seed of the random measure.
        seed: usize = 1, in [0, 1000000000];
    }
}

/// Typical error of stereo matching, pixels.
const DISPARITY_SIGMA: f64 = 0.5;
/// A voxel spans this many distances between measurements, so that one look from the front gives it its points even
/// where the surface only cuts its corner, and this many standard deviations, so that noise stays in two layers.
const EDGE_FACTOR: f64 = 4.0;
/// Finer voxels than this would plan views for details that registration blurs, metres.
const LEAST_EDGE: f64 = 4e-3;

/// Distance between the sensor's rays at its working distance, metres, the larger of the two directions.
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
                s.working_distance.powi(2) / (s.focal_length() * s.baseline) * DISPARITY_SIGMA
            }
            SensorModel::Striper(_) => 0.0,
        };
        (EDGE_FACTOR * ray_spacing(sensor).max(sigma)).max(LEAST_EDGE)
    }

    /// Distance of viewpoints from the surface for `sensor`, metres.
    pub fn distance(&self, sensor: &SensorModel) -> f64 {
        if self.working_distance > 0.0 { self.working_distance } else { sensor.working_distance() }
    }
}
