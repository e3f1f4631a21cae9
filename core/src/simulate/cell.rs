//! A set-up with an object in it: robot, sensor, and what stands round the object.

use super::{NoiseFamily, SimulatedView, Simulator, objects};
use crate::geometry::{Cloud, SensorModel, StereoModel, StriperModel, Surface, Vec3};
use crate::mesh::Mesh;
use crate::robot::{
    HALF_SWEEP_STEPS, Obstacle, RobotModel, SENSOR_FRAME, Trajectory, Workcell, description, home,
};
use crate::voxel::{Voxel, voxel_of};
use crate::{Error, Result};
use rustc_hash::FxHashSet;

/// The jaws' joint, where there is one.
const JAWS: &str = "gripper_left_joint";
/// The jaws hold this much of the object's lower end, metres.
const GRIP: f64 = 0.02;

/// The simulated truth of a set-up. The object stands on z = 0 of the object frame, on the table or between the jaws.
pub struct Cell {
    workcell: Workcell,
    truth: Mesh,
    surface: Surface,
    sensor: SensorModel,
    family: NoiseFamily,
    seed: u64,
    rest: Vec<f64>,
    scans: usize,
    seen: Cloud,
    /// Cells of edge [`SEEN_SPACING`] that hold a point of `seen`.
    taken: FxHashSet<Voxel>,
}

/// The sensor of a set-up.
///
/// # Errors
/// As [`description`].
pub fn sensor_of(setup: &str) -> Result<SensorModel> {
    Ok(if NoiseFamily::of_setup(setup)?.is_stereo() {
        SensorModel::Stereo(StereoModel::GUPPY)
    } else {
        SensorModel::Striper(StriperModel::SCANCONTROL)
    })
}

impl Cell {
    /// The set-up `setup` with the object `truth` (metres); all chance comes from `seed`.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no such set-up, the mesh is no ground truth
    /// ([`objects::check_ground_truth`]), or the jaws cannot hold it.
    pub fn new(setup: &str, truth: Mesh, seed: u64) -> Result<Cell> {
        let family = NoiseFamily::of_setup(setup)?;
        let sensor = sensor_of(setup)?;
        objects::check_ground_truth(&truth)?;
        let truth = standing(truth);
        let workcell = Workcell::new(RobotModel::from_urdf(description(setup)?)?)?;
        let mut rest = home(setup)?;
        if let Some(jaws) = workcell.robot().joints().iter().position(|j| j.name == JAWS) {
            rest[jaws] = opening(&truth, workcell.robot().joints()[jaws].limits[1])?;
        }
        let surface = Surface::new(&truth.vertices, &truth.triangles)?;
        let (seen, taken) = (Cloud::default(), FxHashSet::default());
        Ok(Cell { workcell, truth, surface, sensor, family, seed, rest, scans: 0, seen, taken })
    }

    /// The robot.
    pub fn robot(&self) -> &RobotModel {
        self.workcell.robot()
    }

    /// The sensor.
    pub fn sensor(&self) -> &SensorModel {
        &self.sensor
    }

    /// Where the robot rests, the jaws closed on the object.
    pub fn rest(&self) -> &[f64] {
        &self.rest
    }

    /// The object, where it stands.
    pub fn truth(&self) -> &Mesh {
        &self.truth
    }

    /// The sensor's sweep about `q`, from one end to the other; none for a sensor that rests.
    ///
    /// # Errors
    /// [`Error::Input`] with what is in the way.
    pub fn sweep(&self, q: &[f64]) -> Result<Option<Trajectory>> {
        let length = self.sensor.sweep();
        if length == 0.0 {
            return Ok(None);
        }
        let none = Obstacle::none();
        let way = self.workcell.sweep_path(q, length, HALF_SWEEP_STEPS, &none, 0.0)?;
        way.map(Some).map_err(|why| Error::input(format!("the sensor cannot sweep here: {why}")))
    }

    /// Takes a scan while the robot believes to stand at `q` (in the middle of the sweep, if there is one).
    ///
    /// # Errors
    /// [`Error::Input`] if `q` does not fit the joints.
    pub fn scan(&mut self, q: &[f64]) -> Result<SimulatedView> {
        let reported = self.workcell.object_from_sensor(q)?;
        let surroundings = self.robot().shapes_mesh(&self.visible_links()?, q)?;
        let simulator = Simulator::with_surroundings(
            &self.truth,
            &surroundings,
            self.sensor,
            self.family,
            self.seed,
        )?;
        let view = simulator.scan_at(self.scans, &reported);
        self.scans += 1;
        self.note_seen(&view);
        Ok(view)
    }

    /// The links that do not move with the sensor: it sees past those that do.
    fn visible_links(&self) -> Result<Vec<&str>> {
        let robot = self.robot();
        let own = robot.rigid_with(robot.link(SENSOR_FRAME)?);
        let visible = |link: &usize| !own.contains(link);
        Ok((0..robot.link_names().len())
            .filter(visible)
            .map(|l| robot.link_names()[l].as_str())
            .collect())
    }

    /// Keeps the truth's points that the scan saw.
    fn note_seen(&mut self, view: &SimulatedView) {
        for i in view.scan.returns().filter(|&i| view.labels[i] != super::SURROUNDINGS) {
            let hit = Vec3::from(view.hits[i].map(f64::from));
            let point = view.true_pose.rotation * hit + view.true_pose.translation.vector;
            if point.iter().all(|v| v.is_finite())
                && self.taken.insert(voxel_of(&point, SEEN_SPACING))
            {
                let nearest = self.surface.project(&point);
                // Outliers may stand before the table.
                if nearest.distance < ON_OBJECT {
                    let normal = self.truth.triangle_normal(nearest.triangle);
                    self.seen.push(point, normal, f64::NAN, 1);
                }
            }
        }
    }

    /// The points of the object that the scans so far met, noise-free, object frame, about 0.5 mm apart.
    pub fn seen(&self) -> &Cloud {
        &self.seen
    }

    /// Scans taken so far.
    pub fn scans(&self) -> usize {
        self.scans
    }
}

/// Edge of the cells of which one point seen is kept, metres.
const SEEN_SPACING: f64 = 0.5e-3;
/// A hit this near to the object, metres, is on it: hits are kept in single precision.
const ON_OBJECT: f64 = 1e-5;

/// The object moved so that its lowest point lies on z = 0 and its box is centred on the z axis.
fn standing(mut truth: Mesh) -> Mesh {
    let aabb = truth.aabb();
    let foot = Vec3::new(aabb.center().x, aabb.center().y, aabb.min.z);
    // What stands right already keeps its bits.
    if foot.norm() > 1e-6 {
        truth.vertices.iter_mut().for_each(|v| *v -= foot);
    }
    truth
}

/// How far each jaw stands from the middle to hold the object's lower end, metres.
fn opening(truth: &Mesh, widest: f64) -> Result<f64> {
    let held = truth.vertices.iter().filter(|v| v.z <= GRIP);
    let half = held.map(|v| v.y.abs()).fold(0.0, f64::max);
    if half > widest {
        return Err(Error::input(format!(
            "the object is {:.0} mm wide between the jaws, which open to {:.0} mm: turn it by a quarter about z, \
             or take a smaller one",
            half * 2e3,
            widest * 2e3
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
            let mut cell = Cell::new(setup, objects::make("box").unwrap(), 1).unwrap();
            let q = cell.rest().to_vec();
            assert_eq!(cell.robot().beyond_limits(&q), None);
            let view = cell.scan(&q).unwrap();
            let xi = log(&(view.reported_pose.inverse() * view.true_pose));
            assert!(xi.norm() > 0.0 && xi.norm() < error * 2.0, "{setup}: {xi}");
            assert_eq!(cell.scans(), 1);
            // The next scan of the same pose has errors of its own.
            assert_ne!(cell.scan(&q).unwrap().true_pose, view.true_pose);
        }
    }

    #[test]
    fn jaws_close_on_the_object_or_say_that_it_is_too_wide() {
        let truth = objects::make("coffee").unwrap();
        let half =
            truth.vertices.iter().filter(|v| v.z < GRIP).map(|v| v.y.abs()).fold(0.0, f64::max);
        let cell = Cell::new("omnirob_stereo", truth.clone(), 1).unwrap();
        let jaws = cell.robot().joints().iter().position(|j| j.name == JAWS).unwrap();
        assert!((cell.rest()[jaws] - half).abs() < 1e-12);
        let mut wide = truth;
        wide.vertices.iter_mut().for_each(|v| *v *= 2.0);
        let error = Cell::new("omnirob_stereo", wide, 1).err().unwrap().to_string();
        assert!(error.contains("mm wide between the jaws"), "{error}");
    }
}
