//! Bodies that are known before or from the scans: table and fixture, which are solid, and the
//! obstacle that stands for the object.

use super::params::PlannerParams;
use crate::Result;
use crate::geometry::{Aabb, Pose, Shape, Vec3};
use crate::robot::{OBJECT_FRAME, Obstacle, RobotModel, SENSOR_FRAME};
use crate::scan::Support;
use crate::view::{ViewParams, ViewSpace, VoxelState};
use nalgebra::Point3;

/// Before a surface was measured, the object is taken to fill a ball whose radius is this share of
/// the working distance.
const UNSEEN_RADIUS_RATIO: f64 = 0.4;

/// What views are planned for.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The region of interest, object frame, metres.
    pub region: Aabb,
    /// Measured points that a surface voxel needs, as a multiple of the configured number.
    pub point_factor: usize,
}

/// A body of the fixture that holds the object.
pub(super) struct FixtureBody {
    shape: Shape,
    shape_from_object: Pose,
}

impl FixtureBody {
    fn contains(&self, point: &Vec3) -> bool {
        let local = self.shape_from_object * Point3::from(*point);
        self.shape.distance(&local.coords) <= 0.0
    }
}

/// A space in which nothing was seen. The table and the bodies of the fixture are marked as solid.
///
/// # Errors
/// As [`ViewSpace::new`].
pub(super) fn empty_space(
    planner: &PlannerParams,
    view: &ViewParams,
    target: &Target,
    fixture: &[FixtureBody],
) -> Result<ViewSpace> {
    let min_points = view.min_points.saturating_mul(target.point_factor);
    let view = ViewParams { min_points, ..view.clone() };
    let mut space = ViewSpace::new(planner.sensor(), target.region, &view)?;
    if planner.support == Support::Table {
        space.exclude_below(0.0);
    }
    if !fixture.is_empty() {
        space.exclude_where(|point| fixture.iter().any(|body| body.contains(point)));
    }
    Ok(space)
}

/// The bodies that hold the object while the robot is at the joint positions `joints`.
///
/// # Errors
/// [`crate::Error::Input`] if the robot lacks the object frame or the sensor frame.
pub(super) fn fixture_bodies(robot: &RobotModel, joints: &[f64]) -> Result<Vec<FixtureBody>> {
    let object = robot.link(OBJECT_FRAME)?;
    let holding = robot.links_holding(object, robot.link(SENSOR_FRAME)?);
    let poses = robot.forward_kinematics(joints);
    let bodies = robot.link_shapes().iter().filter(|body| holding.contains(&body.link));
    let placed = bodies.map(|body| {
        let object_from_shape = poses[object].inverse() * poses[body.link] * body.link_from_shape;
        FixtureBody { shape: body.shape, shape_from_object: object_from_shape.inverse() }
    });
    Ok(placed.collect())
}

/// What the robot must keep clear of: the bounding box of the measured surface, or a ball in the
/// region of interest before a surface was measured.
pub(super) fn object_obstacle(space: &ViewSpace, planner: &PlannerParams) -> Obstacle {
    let mut aabb = Aabb::EMPTY;
    for (center, state, _) in space.voxels() {
        if state == VoxelState::Occupied {
            aabb.insert(&center);
        }
    }
    if aabb.diagonal() > 0.0 {
        return Obstacle::from_box(&aabb.padded(space.edge()));
    }
    let radius = UNSEEN_RADIUS_RATIO * planner.sensor().working_distance();
    Obstacle::from_sphere(&space.roi().center(), radius)
}
