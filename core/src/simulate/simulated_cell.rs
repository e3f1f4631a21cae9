//! A set-up with an object in it: robot, sensor, and what surrounds the object.

use super::labels::SURROUNDINGS_LABEL;
use super::noise_family::NoiseFamily;
use super::objects;
use super::simulated_view::SimulatedView;
use super::simulator::Simulator;
use crate::geometry::{Cloud, SensorModel, StereoModel, StriperModel, Surface, Vec3, transform};
use crate::mesh::Mesh;
use crate::robot::{
    HALF_SWEEP_STEPS, Obstacle, RobotModel, SENSOR_FRAME, Trajectory, Workcell, home_configuration,
    setup_urdf,
};
use crate::voxel::{Voxel, voxel_of};
use crate::{Error, Result};
use rustc_hash::FxHashSet;

/// The joint of the gripper's jaws, in set-ups that have a gripper.
const JAW_JOINT: &str = "gripper_left_joint";
/// Height of the object's lower end that the jaws hold, metres.
const GRIP_HEIGHT: f64 = 0.02;
/// Edge of the cells in each of which one seen point is kept, metres.
const SEEN_SPACING: f64 = 0.5e-3;
/// A hit lies on the object if it is nearer than this, metres; hits are in single precision.
const MAX_HIT_DISTANCE: f64 = 1e-5;
/// An object whose foot is nearer to the origin than this is not moved, metres, so that its
/// coordinates keep their bits.
const MIN_FOOT_OFFSET: f64 = 1e-6;

/// The simulated truth of a set-up. The object stands on z = 0 of the object frame, on the table or
/// between the jaws.
pub struct SimulatedCell {
    workcell: Workcell,
    truth: Mesh,
    surface: Surface,
    sensor: SensorModel,
    family: NoiseFamily,
    seed: u64,
    rest: Vec<f64>,
    scan_count: usize,
    seen: Cloud,
    /// Cells of edge [`SEEN_SPACING`] that hold a point of `seen`.
    seen_cells: FxHashSet<Voxel>,
}

/// The sensor of a set-up.
///
/// # Errors
/// As [`setup_urdf`].
pub fn setup_sensor(setup: &str) -> Result<SensorModel> {
    Ok(if NoiseFamily::from_setup(setup)?.is_stereo() {
        SensorModel::Stereo(StereoModel::GUPPY)
    } else {
        SensorModel::Striper(StriperModel::SCANCONTROL)
    })
}

impl SimulatedCell {
    /// The set-up `setup` with the object `truth` (metres); all random numbers come from `seed`.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no such set-up, the mesh is no ground truth
    /// ([`objects::check_ground_truth`]), or the jaws cannot hold it.
    pub fn new(setup: &str, truth: Mesh, seed: u64) -> Result<SimulatedCell> {
        let family = NoiseFamily::from_setup(setup)?;
        let sensor = setup_sensor(setup)?;
        objects::check_ground_truth(&truth)?;
        let truth = place_on_origin(truth);
        let workcell = Workcell::new(RobotModel::from_urdf(setup_urdf(setup)?)?)?;
        let mut rest = home_configuration(setup)?;
        if let Some(jaw) = workcell.robot().joints().iter().position(|j| j.name == JAW_JOINT) {
            rest[jaw] = jaw_opening(&truth, workcell.robot().joints()[jaw].limits[1])?;
        }
        let surface = Surface::new(&truth.vertices, &truth.triangles)?;
        Ok(SimulatedCell {
            workcell,
            truth,
            surface,
            sensor,
            family,
            seed,
            rest,
            scan_count: 0,
            seen: Cloud::default(),
            seen_cells: FxHashSet::default(),
        })
    }

    /// The robot.
    pub fn robot(&self) -> &RobotModel {
        self.workcell.robot()
    }

    /// The sensor.
    pub fn sensor(&self) -> &SensorModel {
        &self.sensor
    }

    /// Joint positions in which the robot rests, with the jaws closed on the object, radians and
    /// metres.
    pub fn rest_configuration(&self) -> &[f64] {
        &self.rest
    }

    /// The object at its place, object frame, metres.
    pub fn truth(&self) -> &Mesh {
        &self.truth
    }

    /// The sensor's sweep about the joint positions `q`, from one end to the other; `None` for a
    /// sensor that does not move during a scan.
    ///
    /// # Errors
    /// [`Error::Input`] that says what is in the way.
    pub fn sweep(&self, q: &[f64]) -> Result<Option<Trajectory>> {
        let length = self.sensor.sweep_length();
        if length == 0.0 {
            return Ok(None);
        }
        let sweep =
            self.workcell.plan_sweep(q, length, HALF_SWEEP_STEPS, &Obstacle::empty(), 0.0)?;
        sweep.map(Some).map_err(|why| Error::input(format!("the sensor cannot sweep here: {why}")))
    }

    /// Takes a scan while the robot reports the joint positions `q`; they are those in the middle
    /// of the sweep, if there is one.
    ///
    /// # Errors
    /// [`Error::Input`] if `q` does not fit the joints.
    pub fn scan(&mut self, q: &[f64]) -> Result<SimulatedView> {
        let reported = self.workcell.object_from_sensor(q)?;
        let surroundings = self.robot().link_shapes_mesh(&self.visible_links()?, q)?;
        let simulator = Simulator::with_surroundings(
            &self.truth,
            &surroundings,
            self.sensor,
            self.family,
            self.seed,
        )?;
        let view = simulator.scan_at(self.scan_count, &reported);
        self.scan_count += 1;
        self.record_seen_points(&view);
        Ok(view)
    }

    /// The links that do not move with the sensor. Those that do are out of its sight.
    fn visible_links(&self) -> Result<Vec<&str>> {
        let robot = self.robot();
        let with_sensor = robot.links_rigid_with(robot.link(SENSOR_FRAME)?);
        Ok((0..robot.link_names().len())
            .filter(|link| !with_sensor.contains(link))
            .map(|link| robot.link_names()[link].as_str())
            .collect())
    }

    /// Records the points of the truth that the scan saw.
    fn record_seen_points(&mut self, view: &SimulatedView) {
        for i in view.scan.returns().filter(|&i| view.labels[i] != SURROUNDINGS_LABEL) {
            let hit = Vec3::from(view.hits[i].map(f64::from));
            let point = transform(&view.true_pose, &hit);
            if point.iter().all(|v| v.is_finite())
                && self.seen_cells.insert(voxel_of(&point, SEEN_SPACING))
            {
                let nearest = self.surface.project(&point);
                // The ray of an outlier may have met the table.
                if nearest.distance < MAX_HIT_DISTANCE {
                    let normal = self.truth.triangle_normal(nearest.triangle);
                    self.seen.push(point, normal, f64::NAN, 1);
                }
            }
        }
    }

    /// The points of the object that the scans so far met, noise-free, object frame, about 0.5 mm
    /// apart.
    pub fn seen_points(&self) -> &Cloud {
        &self.seen
    }

    /// Number of scans taken so far.
    pub fn scan_count(&self) -> usize {
        self.scan_count
    }
}

/// The object moved so that its lowest point lies on z = 0 and its box is centred on the z axis.
fn place_on_origin(mut truth: Mesh) -> Mesh {
    let aabb = truth.aabb();
    let foot = Vec3::new(aabb.center().x, aabb.center().y, aabb.min.z);
    if foot.norm() > MIN_FOOT_OFFSET {
        truth.vertices.iter_mut().for_each(|v| *v -= foot);
    }
    truth
}

/// Distance of each jaw from the middle when they hold the object's lower end, metres.
fn jaw_opening(truth: &Mesh, max_opening: f64) -> Result<f64> {
    let held = truth.vertices.iter().filter(|v| v.z <= GRIP_HEIGHT);
    let half = held.map(|v| v.y.abs()).fold(0.0, f64::max);
    if half > max_opening {
        return Err(Error::input(format!(
            "the object is {:.0} mm wide between the jaws, which open to {:.0} mm: turn it by a quarter about z, \
             or take a smaller one",
            half * 2e3,
            max_opening * 2e3
        )));
    }
    Ok(half)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::log;

    #[test]
    fn each_set_up_sees_the_object_and_what_holds_it_from_where_tf_nearly_says() {
        for (setup, error) in [("kr16_laser", 0.4e-3), ("omnirob_stereo", 12e-3)] {
            let mut cell =
                SimulatedCell::new(setup, objects::make_object("box").unwrap(), 1).unwrap();
            let q = cell.rest_configuration().to_vec();
            assert_eq!(cell.robot().joint_beyond_limits(&q), None);
            let view = cell.scan(&q).unwrap();
            let xi = log(&(view.reported_pose.inverse() * view.true_pose));
            assert!(xi.norm() > 0.0 && xi.norm() < error * 2.0, "{setup}: {xi}");
            assert_eq!(cell.scan_count(), 1);
            // The next scan of the same pose has errors of its own.
            assert_ne!(cell.scan(&q).unwrap().true_pose, view.true_pose);
        }
    }

    #[test]
    fn jaws_close_on_the_object_or_say_that_it_is_too_wide() {
        let truth = objects::make_object("coffee").unwrap();
        let half = truth
            .vertices
            .iter()
            .filter(|v| v.z < GRIP_HEIGHT)
            .map(|v| v.y.abs())
            .fold(0.0, f64::max);
        let cell = SimulatedCell::new("omnirob_stereo", truth.clone(), 1).unwrap();
        let jaws = cell.robot().joints().iter().position(|j| j.name == JAW_JOINT).unwrap();
        assert!((cell.rest_configuration()[jaws] - half).abs() < 1e-12);
        let mut wide = truth;
        wide.vertices.iter_mut().for_each(|v| *v *= 2.0);
        let error = SimulatedCell::new("omnirob_stereo", wide, 1).err().unwrap().to_string();
        assert!(error.contains("mm wide between the jaws"), "{error}");
    }
}
