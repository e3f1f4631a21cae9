//! Parameters of the simulation.

use super::noise_family::NoiseFamily;

crate::params! {
    /// What is simulated.
    pub struct SimulateParams("simulate") {
        /// Noise of robot and sensor: exact poses and laser, KR16 and laser, LWR and laser, or LWR
        /// and stereo.
        family: NoiseFamily = NoiseFamily::P2K;
        /// Number of views, spread evenly over the sphere of directions.
        views: usize = 26, in [1, 10_000];
        /// Distance from the laser to the object's centre; larger for objects that do not fit its
        /// fan.
        laser_distance: f64 = 0.3, in [0.05, 10.0], unit "m";
        /// Distance between the points of a laser profile at the laser's working distance.
        point_spacing: f64 = 0.35e-3, in [1e-5, 0.1], unit "m";
        /// Distance between laser profiles.
        profile_spacing: f64 = 0.5e-3, in [1e-5, 0.1], unit "m";
        /// Distance from the stereo pair to the object's centre; larger for objects that would be
        /// too near.
        stereo_distance: f64 = 0.65, in [0.1, 10.0], unit "m";
    }
}
