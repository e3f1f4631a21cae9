//! A sensor and a robot in front of an object.

use super::noise_family::NoiseFamily;
use super::params::SimulateParams;
use super::random::RandomSource;
use super::scene::SimulatedScene;
use super::simulated_view::{SimulatedScans, SimulatedView};
use super::view_poses::view_poses;
use super::{laser, objects, pose_error, stereo};
use crate::geometry::{Pose, SensorModel};
use crate::mesh::Mesh;
use crate::scan::PoseSigma;
use crate::{Progress, Result};

/// A sensor and a robot in front of a fixed object.
pub struct Simulator {
    scene: SimulatedScene,
    family: NoiseFamily,
    sensor: SensorModel,
    seed: u64,
}

impl Simulator {
    /// Puts the object `truth` (metres, object frame) alone in front of a sensor that fits its
    /// size.
    ///
    /// # Errors
    /// As [`objects::check_ground_truth`].
    pub fn new(truth: &Mesh, params: &SimulateParams, seed: u64) -> Result<Simulator> {
        objects::check_ground_truth(truth)?;
        let scene = SimulatedScene::new(truth, &Mesh::default())?;
        let family = params.family;
        let sensor = if family.is_stereo() {
            SensorModel::Stereo(stereo::fit_model(&scene, params))
        } else {
            SensorModel::Striper(laser::fit_model(&scene, params))
        };
        Ok(Simulator { scene, family, sensor, seed })
    }

    /// Puts the object `truth` and its surroundings (metres, object frame; their triangles face
    /// outwards) in front of `sensor`. The noise of sensor and robot is that of `family`.
    ///
    /// # Errors
    /// As [`objects::check_ground_truth`].
    pub fn with_surroundings(
        truth: &Mesh,
        surroundings: &Mesh,
        sensor: SensorModel,
        family: NoiseFamily,
        seed: u64,
    ) -> Result<Simulator> {
        objects::check_ground_truth(truth)?;
        let scene = SimulatedScene::new(truth, surroundings)?;
        Ok(Simulator { scene, family, sensor, seed })
    }

    /// Distance from the sensor to the object's centre, metres.
    pub fn distance(&self) -> f64 {
        self.sensor.working_distance()
    }

    /// The true poses `object_from_sensor` of `count` views spread over the sphere.
    pub fn view_poses(&self, count: usize) -> Vec<Pose> {
        view_poses(&self.scene.aabb, self.distance(), count)
    }

    /// Takes scan number `view` from `true_pose` (`object_from_sensor`). A laser sweep is centred
    /// on the pose.
    pub fn scan(&self, view: usize, true_pose: &Pose) -> SimulatedView {
        let error = pose_error::draw_pose_error(self.family, self.random_source(view));
        self.simulate_view(view, true_pose, true_pose * error.inverse())
    }

    /// Takes scan number `view` while the robot reports `reported_pose` (`object_from_sensor`). The
    /// true pose differs from it by a random error.
    pub fn scan_at(&self, view: usize, reported_pose: &Pose) -> SimulatedView {
        let error = pose_error::draw_pose_error(self.family, self.random_source(view));
        self.simulate_view(view, &(reported_pose * error), *reported_pose)
    }

    fn simulate_view(&self, view: usize, true_pose: &Pose, reported_pose: Pose) -> SimulatedView {
        let source = self.random_source(view);
        let output = match self.sensor {
            SensorModel::Stereo(model) => stereo::scan(&self.scene, &model, true_pose, source),
            SensorModel::Striper(model) => {
                laser::Striper::new(model, &self.scene).scan(&self.scene, true_pose, source)
            }
        };
        SimulatedView {
            scan: output.scan,
            reported_pose,
            true_pose: *true_pose,
            labels: output.labels,
            hits: output.hits,
        }
    }

    fn random_source(&self, view: usize) -> RandomSource {
        RandomSource { seed: self.seed, view: view as u64 }
    }

    /// The standard deviation of its poses that the robot states.
    pub fn pose_sigma(&self) -> PoseSigma {
        pose_error::pose_sigma(self.family)
    }
}

/// Scans `truth` (metres, object frame) from views spread over the sphere.
///
/// # Errors
/// As [`objects::check_ground_truth`]; [`crate::Error::Cancelled`] between views.
pub fn simulate(
    truth: &Mesh,
    params: &SimulateParams,
    seed: u64,
    progress: &Progress,
) -> Result<SimulatedScans> {
    let simulator = Simulator::new(truth, params, seed)?;
    let poses = simulator.view_poses(params.views);
    let mut views = Vec::with_capacity(poses.len());
    for (i, pose) in poses.iter().enumerate() {
        progress.report("simulate", i as f64 / poses.len() as f64)?;
        views.push(simulator.scan(i, pose));
    }
    progress.report("simulate", 1.0)?;
    Ok(SimulatedScans { family: params.family, views, pose_sigma: simulator.pose_sigma() })
}
