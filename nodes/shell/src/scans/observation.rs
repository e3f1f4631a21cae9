//! From a cloud and the transforms to what the sensor saw of the object.

use super::ScanParams;
use crate::convert::scan_from_message;
use crate::{Stamp, TfBuffer};
use nalgebra::Point3;
use puffer_core::geometry::{Pose, Scan, Shape, Vec3};
use puffer_core::robot::{BodyFilter, RobotModel};
use puffer_core::voxel::CellIndex;
use puffer_msgs::sensor_msgs::msg::PointCloud2;

/// How many standard deviations of the robot's pose are added to the margin before a scan is registered.
const CAUTION: f64 = 2.0;

/// A scan as it came, and where everything was.
pub struct Observation {
    /// When.
    pub stamp: Stamp,
    /// The sensor's frame, as the driver calls it.
    pub frame: String,
    /// Returns within the region of interest, sensor frame.
    scan: Scan,
    /// Some of those outside.
    outside: Scan,
    /// The robot's `object_from_sensor`.
    pub prior: Pose,
    /// Bodies of robot, gripper and table, each with its pose `object_from_shape`.
    bodies: Vec<(Shape, Pose)>,
}

impl Observation {
    /// Puts a cloud and the transforms at its stamp together. `robot` describes the bodies to cut; without it none is.
    ///
    /// # Errors
    /// What of the cloud does not fit, or which transform is missing, in words.
    pub fn new(
        cloud: &PointCloud2,
        tf: &TfBuffer,
        robot: Option<&RobotModel>,
        params: &ScanParams,
    ) -> Result<Observation, String> {
        let stamp = Stamp::new(cloud.header.stamp.sec, cloud.header.stamp.nanosec);
        let look = |frame: &str| {
            tf.lookup(&params.object_frame, frame, stamp).map_err(|error| error.to_string())
        };
        let prior = look(&cloud.header.frame_id)?;
        let mut bodies = Vec::new();
        if let Some(robot) = robot {
            let sensor = robot.link(&cloud.header.frame_id).map_err(|e| e.to_string())?;
            let own = robot.rigid_with(sensor);
            for body in robot.link_shapes().iter().filter(|body| !own.contains(&body.link)) {
                let object_from_link = look(&robot.link_names()[body.link])?;
                bodies.push((body.shape, object_from_link * body.link_from_shape));
            }
        }
        let scan = scan_from_message(cloud)?;
        let inside = |p: &Vec3| {
            p.xy().norm() <= params.radius && (-params.depth..=params.height).contains(&p.z)
        };
        // The region is for the eye: the pose error does not matter to it.
        let (kept, rest): (Vec<usize>, Vec<usize>) = scan.returns().partition(|&i| {
            scan.point(i).is_some_and(|p| inside(&(prior * Point3::from(p)).coords))
        });
        let (inside, outside) = (select(&scan, &kept), thinned(&select(&scan, &rest)));
        let frame = cloud.header.frame_id.clone();
        Ok(Observation { stamp, frame, scan: inside, outside, prior, bodies })
    }

    /// In place of a scan that cannot be used.
    pub(super) fn nothing(stamp: Stamp, frame: &str) -> Observation {
        let (prior, bodies) = (Pose::identity(), Vec::new());
        let (frame, scan, outside) = (frame.to_owned(), Scan::default(), Scan::default());
        Observation { stamp, frame, scan, outside, prior, bodies }
    }

    /// The points that surely are not on a body while the pose is only what the robot says.
    pub(super) fn before_registration(&self, params: &ScanParams) -> Cut {
        let sigma = params.pose_sigma();
        let distance = self.prior.translation.vector.norm();
        let margin =
            params.body_margin + CAUTION * sigma.translation.hypot(sigma.rotation * distance);
        self.cut(&self.prior, margin)
    }

    /// The points that are not on a body when the sensor stood at `object_from_sensor`.
    pub(super) fn at(&self, object_from_sensor: &Pose, params: &ScanParams) -> Cut {
        self.cut(object_from_sensor, params.body_margin)
    }

    fn cut(&self, object_from_sensor: &Pose, margin: f64) -> Cut {
        let sensor_from_object = object_from_sensor.inverse();
        let placed: Vec<(Shape, Pose)> =
            self.bodies.iter().map(|(shape, pose)| (*shape, sensor_from_object * pose)).collect();
        let points: Vec<Vec3> =
            self.scan.points.iter().map(|p| Vec3::from(p.map(f64::from))).collect();
        let on_body = BodyFilter::new(&placed, margin).on_body(&points);
        let (cut, kept): (Vec<usize>, Vec<usize>) = (0..points.len()).partition(|&i| on_body[i]);
        let mut beyond = thinned(&select(&self.scan, &cut));
        beyond.points.extend_from_slice(&self.outside.points);
        beyond.origins.extend_from_slice(&self.outside.origins);
        Cut { object: select(&self.scan, &kept), beyond }
    }
}

/// A scan divided.
#[derive(Clone, Default)]
pub(super) struct Cut {
    /// What may be the object.
    pub object: Scan,
    /// Some of the rest: nothing stands before it.
    pub beyond: Scan,
}

/// Edge of the cells of which one point is kept of what lies beyond the object, metres: enough to see free space.
const THINNED: f64 = 0.005;

/// One point a cell, the first.
fn thinned(scan: &Scan) -> Scan {
    let points: Vec<Vec3> = scan.points.iter().map(|p| Vec3::from(p.map(f64::from))).collect();
    let cells = CellIndex::new(&points, THINNED);
    let first = |cell: &[i32; 3]| cells.points_in(*cell).first().map(|&i| i as usize);
    let kept: Vec<usize> = cells.cells().iter().filter_map(first).collect();
    select(scan, &kept)
}

/// The points at `indices`, no longer in rows.
fn select(scan: &Scan, indices: &[usize]) -> Scan {
    let origins = match scan.origins.as_slice() {
        [] => Vec::new(),
        origins => indices.iter().map(|&i| origins[i]).collect(),
    };
    Scan { points: indices.iter().map(|&i| scan.points[i]).collect(), width: 0, origins }
}
