//! A scan as it was taken, and what of it may be the object.

use super::params::{CutParams, Region};
use super::thinning::{points_of, select, thin};
use crate::Result;
use crate::geometry::{Pose, Scan, Shape, transform};
use crate::robot::{BodyFilter, RobotModel};

/// The margin about bodies grows by this many standard deviations of the robot's pose until the
/// scan is registered: a point of a body that is kept would be modelled, one of the object that is
/// cut only costs overlap and comes back once the pose is known.
const MARGIN_POSE_SIGMAS: f64 = 2.0;
/// Edge of the cells of which one point is kept of what lies beyond the object, metres: enough to
/// see which space is free.
const BEYOND_CELL_M: f64 = 0.005;

/// When a scan was taken and in which frame its points are; passed through to those who publish it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ScanLabel {
    /// Time of the scan on the clock of the transforms, nanoseconds.
    pub nanoseconds: i64,
    /// Name of the sensor frame.
    pub frame: String,
}

/// A scan with the pose of the sensor and of all bodies when it was taken.
#[derive(Clone, Debug)]
pub struct Observation {
    /// When, and in which sensor frame.
    pub label: ScanLabel,
    /// The robot's `object_from_sensor`.
    pub prior: Pose,
    /// Returns within the region, sensor frame.
    inside: Scan,
    /// Some of the returns outside of it, sensor frame.
    outside: Scan,
    /// Bodies of robot, gripper and table, each with its pose `object_from_shape`.
    bodies: Vec<(Shape, Pose)>,
}

impl Observation {
    /// Puts a scan (sensor frame), the robot's pose `object_from_sensor` and the bodies to cut,
    /// each with its pose `object_from_shape`, together.
    pub fn new(
        label: ScanLabel,
        scan: &Scan,
        prior: Pose,
        bodies: Vec<(Shape, Pose)>,
        region: &Region,
    ) -> Observation {
        // The region only bounds what is looked at: the error of the pose does not matter to it.
        let (kept, rest): (Vec<usize>, Vec<usize>) = scan
            .returns()
            .partition(|&i| scan.point(i).is_some_and(|p| region.contains(&transform(&prior, &p))));
        let inside = select(scan, &kept);
        let outside = thin(&select(scan, &rest), BEYOND_CELL_M);
        Observation { label, prior, inside, outside, bodies }
    }

    /// Stands for a scan that cannot be used.
    pub(super) fn without_points(label: ScanLabel) -> Observation {
        Observation {
            label,
            prior: Pose::identity(),
            inside: Scan::default(),
            outside: Scan::default(),
            bodies: Vec::new(),
        }
    }

    /// Cuts the points that may lie on a body while nothing but the robot's pose is known.
    pub(super) fn split_at_prior(&self, params: &CutParams) -> SplitScan {
        let distance = self.prior.translation.vector.norm();
        let pose_error = params.pose_sigma.point_sigma(distance);
        self.split(&self.prior, params.body_margin + MARGIN_POSE_SIGMAS * pose_error)
    }

    /// Cuts the points that lie on a body if the sensor stood at `object_from_sensor`.
    pub(super) fn split_at(&self, object_from_sensor: &Pose, params: &CutParams) -> SplitScan {
        self.split(object_from_sensor, params.body_margin)
    }

    fn split(&self, object_from_sensor: &Pose, margin: f64) -> SplitScan {
        let sensor_from_object = object_from_sensor.inverse();
        let placed: Vec<(Shape, Pose)> =
            self.bodies.iter().map(|(shape, pose)| (*shape, sensor_from_object * pose)).collect();
        let on_body = BodyFilter::new(&placed, margin).mask_on_bodies(&points_of(&self.inside));
        let (cut, kept): (Vec<usize>, Vec<usize>) = (0..on_body.len()).partition(|&i| on_body[i]);
        let mut beyond = thin(&select(&self.inside, &cut), BEYOND_CELL_M);
        beyond.points.extend_from_slice(&self.outside.points);
        beyond.origins.extend_from_slice(&self.outside.origins);
        SplitScan { object: select(&self.inside, &kept), beyond }
    }
}

/// A scan divided into object and rest, sensor frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SplitScan {
    /// The points that may be the object's.
    pub object: Scan,
    /// Some of the other points: the space before them is free.
    pub beyond: Scan,
}

/// The bodies of a robot that do not move with the sensor, each with its pose `object_from_shape`.
///
/// `object_from_link` looks the pose of the link of that name up; it is asked for each body.
///
/// # Errors
/// [`crate::Error::Input`] if the robot has no link `sensor_frame`; whatever `object_from_link`
/// fails with.
pub fn posed_bodies(
    robot: &RobotModel,
    sensor_frame: &str,
    mut object_from_link: impl FnMut(&str) -> Result<Pose>,
) -> Result<Vec<(Shape, Pose)>> {
    let sensor = robot.link(sensor_frame)?;
    let moving_with_sensor = robot.links_rigid_with(sensor);
    robot
        .link_shapes()
        .iter()
        .filter(|body| !moving_with_sensor.contains(&body.link))
        .map(|body| {
            let object_from_link = object_from_link(&robot.link_names()[body.link])?;
            Ok((body.shape, object_from_link * body.link_from_shape))
        })
        .collect()
}
