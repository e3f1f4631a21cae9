//! Simulated objects, sensors and robots.
//!
//! A [`Simulator`] looks at a closed mesh with one of two sensors: a laser striper swept by an arm, or a
//! stereo pair. Each point of a scan comes with its noise-free hit and a label, each view with its true pose
//! and the one that the robot reports. All chance comes from the seed, the view and the row, so that results
//! depend neither on the threads nor on the order of the views.

mod cell;
mod labels;
mod laser;
mod noise;
pub mod objects;
mod robot;
mod scene;
mod stereo;
mod truth;
mod views;

pub use cell::{Cell, sensor_of};
pub use labels::{FLYING, GOOD, OUTLIER, SURROUNDINGS};
pub use noise::NoiseFamily;
pub(crate) use noise::direction;
pub use truth::{TrueNoise, add_outliers, outlier_share};
pub use views::view_poses;

use crate::geometry::{Pose, Scan, SensorModel, Vec3};
use crate::mesh::Mesh;
use crate::scans::PoseSigma;
use crate::{Progress, Result};

crate::params! {
    /// What is simulated.
    pub struct SimulateParams("simulate") {
        /// Noise family of sensor and robot: exact poses and laser, KR16 and laser, LWR and laser, LWR and stereo.
        family: NoiseFamily = NoiseFamily::P2K;
        /// Number of views, spread evenly over the sphere of directions.
        views: usize = 26, in [1, 10_000];
        /// Distance from the laser to the object's middle; larger for objects that do not fit the fan.
        laser_distance: f64 = 0.3, in [0.05, 10.0], unit "m";
        /// Distance between the points of a profile at the laser's working distance.
        point_spacing: f64 = 0.35e-3, in [1e-5, 0.1], unit "m";
        /// Distance between profiles.
        profile_spacing: f64 = 0.5e-3, in [1e-5, 0.1], unit "m";
        /// Distance from the stereo pair to the object's middle; larger for objects that would be too near.
        stereo_distance: f64 = 0.65, in [0.1, 10.0], unit "m";
    }
}

/// One simulated scan. All vectors are as long as `scan.points`; no return is NaN and has the label [`GOOD`].
#[derive(Clone, Debug)]
pub struct SimulatedView {
    /// What the sensor delivers, sensor frame.
    pub scan: Scan,
    /// `object_from_sensor` as the robot reports it.
    pub reported_pose: Pose,
    /// `object_from_sensor` as it was.
    pub true_pose: Pose,
    /// [`GOOD`], [`OUTLIER`], [`FLYING`] or [`SURROUNDINGS`].
    pub labels: Vec<u8>,
    /// Where the ray truly met the object, in the true sensor frame, metres.
    pub hits: Vec<[f32; 3]>,
}

/// All scans of a simulation.
#[derive(Clone, Debug)]
pub struct SimulatedScans {
    /// The noise family that made them.
    pub family: NoiseFamily,
    /// The views in the order of their numbers.
    pub views: Vec<SimulatedView>,
    /// What the robot states of its poses.
    pub pose_sigma: PoseSigma,
}

/// A sensor and a robot before a fixed object.
pub struct Simulator {
    scene: scene::Scene,
    family: NoiseFamily,
    sensor: SensorModel,
    seed: u64,
}

impl Simulator {
    /// Sets the object `truth` (metres, object frame) alone before a sensor that fits its size.
    ///
    /// # Errors
    /// As [`objects::check_ground_truth`].
    pub fn new(truth: &Mesh, params: &SimulateParams, seed: u64) -> Result<Simulator> {
        objects::check_ground_truth(truth)?;
        let scene = scene::Scene::new(truth, &Mesh::default())?;
        let family = params.family;
        let sensor = if family.is_stereo() {
            SensorModel::Stereo(stereo::model_for(&scene, params))
        } else {
            SensorModel::Striper(laser::model_for(&scene, params))
        };
        Ok(Simulator { scene, family, sensor, seed })
    }

    /// Sets the object `truth` and what stands round it (metres, object frame; its triangles face outwards)
    /// before `sensor`, whose noise is that of `family`, on a robot of the same.
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
        Ok(Simulator { scene: scene::Scene::new(truth, surroundings)?, family, sensor, seed })
    }

    /// Distance from the sensor to the object's middle, metres.
    pub fn distance(&self) -> f64 {
        self.sensor.working_distance()
    }

    /// The true poses `object_from_sensor` of `count` views spread over the sphere.
    pub fn view_poses(&self, count: usize) -> Vec<Pose> {
        view_poses(&self.scene.aabb, self.distance(), count)
    }

    /// Scan number `view` from `true_pose` (`object_from_sensor`). A laser sweep is centred on the pose.
    pub fn scan(&self, view: usize, true_pose: &Pose) -> SimulatedView {
        let error = robot::pose_error(self.family, self.dice(view));
        self.look(view, true_pose, true_pose * error.inverse())
    }

    /// Scan number `view`, taken while the robot reports `reported_pose` (`object_from_sensor`) and stands a little
    /// beside it.
    pub fn scan_at(&self, view: usize, reported_pose: &Pose) -> SimulatedView {
        let error = robot::pose_error(self.family, self.dice(view));
        self.look(view, &(reported_pose * error), *reported_pose)
    }

    fn look(&self, view: usize, true_pose: &Pose, reported_pose: Pose) -> SimulatedView {
        let dice = self.dice(view);
        let (scan, labels, hits) = match self.sensor {
            SensorModel::Stereo(model) => stereo::scan(&self.scene, &model, true_pose, dice),
            SensorModel::Striper(model) => {
                laser::Striper::new(model, &self.scene).scan(&self.scene, true_pose, dice)
            }
        };
        SimulatedView { scan, reported_pose, true_pose: *true_pose, labels, hits }
    }

    fn dice(&self, view: usize) -> noise::Dice {
        noise::Dice { seed: self.seed, view: view as u64 }
    }

    /// What the robot states of its poses.
    pub fn pose_sigma(&self) -> PoseSigma {
        robot::pose_sigma(self.family)
    }
}

/// Scans `truth` from views spread over the sphere.
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

fn f32s(v: &Vec3) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

#[cfg(test)]
mod tests;
