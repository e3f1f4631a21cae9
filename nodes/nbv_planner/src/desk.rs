//! Everything that planning rests on: the space seen so far, the robot, and where it stands.

use crate::Params;
use anyhow::{Context, Result, anyhow};
use nalgebra::Point3;
use puffer_core::geometry::{Aabb, Pose, Scan, Shape};
use puffer_core::register::Status;
use puffer_core::robot::{
    OBJECT_FRAME, Obstacle, Reach, ReachRequest, Reached, RobotModel, SENSOR_FRAME, Workcell,
    slide_range,
};
use puffer_core::scans::Support;
use puffer_core::view::{Plan, ReachedView, State, ViewParams, ViewSpace, next_view};
use puffer_msgs::msg::{RegisteredPoses, RegisteredScan};
use puffer_msgs::sensor_msgs::msg::JointState;
use puffer_msgs::srv::PlanViewRequest;
use puffer_shell::convert::{
    pose_from_message, region_from_message, scan_from_message, status_from_message,
};
use std::collections::BTreeMap;

/// Before anything was seen, the object is taken to fill a ball of this share of the working distance.
const UNSEEN_SHARE: f64 = 0.4;

/// The planner's state.
pub(crate) struct Desk {
    params: Params,
    space: ViewSpace,
    scans: BTreeMap<u32, Held>,
    robot: Option<Workcell>,
    description: String,
    /// What is wrong with the newest description.
    fault: Option<String>,
    joints: Option<Vec<f64>>,
    /// Whether the space must be made anew because poses have changed.
    stale: bool,
    /// That of the newest corrected poses, 0 without.
    revision: u32,
    /// What the space was made for.
    aim: Aim,
}

/// What views are planned for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Aim {
    /// The region of interest, object frame, metres.
    pub region: Aabb,
    /// Points that a surface voxel needs, times those configured.
    pub factor: usize,
}

struct Held {
    scan: Scan,
    beyond: Scan,
    pose: Pose,
    status: Status,
}

/// What a request gets.
pub(crate) struct Answer {
    pub plan: Plan,
    /// How the chosen view is taken.
    pub reached: Option<Reached>,
    pub voxel_edge: f64,
}

impl Desk {
    pub(crate) fn new(params: Params) -> Result<Desk> {
        let aim = Aim { region: params.planner.region(), factor: 1 };
        let space = empty_space(&params, &aim, None)?;
        Ok(Desk {
            params,
            space,
            scans: BTreeMap::new(),
            robot: None,
            description: String::new(),
            fault: None,
            joints: None,
            stale: false,
            revision: 0,
            aim,
        })
    }

    /// Number of scans that came.
    pub(crate) fn scans(&self) -> usize {
        self.scans.len()
    }

    /// Names of the robot's joints; empty without a robot.
    pub(crate) fn joint_names(&self) -> Vec<String> {
        let joints = self.robot.as_ref().map_or(&[][..], |w| w.robot().joints());
        joints.iter().map(|joint| joint.name.clone()).collect()
    }

    /// What the space knows.
    pub(crate) fn space(&self) -> &ViewSpace {
        &self.space
    }

    /// What a request asks views for.
    ///
    /// # Errors
    /// A region that is none, in words.
    pub(crate) fn aim(&self, request: &PlanViewRequest) -> Result<Aim> {
        let region = region_from_message(&request.roi, &self.params.planner.region())
            .map_err(anyhow::Error::msg)?;
        Ok(Aim { region, factor: request.point_factor.max(1) as usize })
    }

    /// What is missing for a plan with `scans` scans and their poses of this revision, in words.
    pub(crate) fn missing(&self, scans: usize, revision: u32) -> Option<String> {
        if self.robot.is_none() {
            Some("no robot_description came: start the driver or robot_state_publisher".to_owned())
        } else if self.joints.is_none() {
            Some("no joint_states for all joints of the robot came".to_owned())
        } else if self.scans.len() < scans {
            Some(format!("{} of {scans} scans came", self.scans.len()))
        } else {
            (self.revision < revision).then(|| {
                format!("corrected poses of revision {} of {revision} came", self.revision)
            })
        }
    }

    /// Takes the robot's description; the same one again changes nothing.
    pub(crate) fn describe(&mut self, urdf: &str) -> Result<()> {
        if self.description == urdf {
            return Ok(());
        }
        // Planning goes on with the newest description or none.
        self.description = urdf.to_owned();
        (self.robot, self.joints, self.stale) = (None, None, true);
        let workcell = RobotModel::from_urdf(urdf).and_then(Workcell::new);
        let workcell = workcell.context("robot_description");
        self.fault = workcell.as_ref().err().map(|error| format!("{error:#}"));
        self.robot = Some(workcell?);
        Ok(())
    }

    /// What is wrong with the robot's description, which waiting does not mend.
    pub(crate) fn fault(&self) -> Option<String> {
        self.fault.clone()
    }

    /// Takes the joint positions; names that the robot does not have are passed over.
    pub(crate) fn stand(&mut self, state: &JointState) {
        if let Some(joints) = self.robot.as_ref().and_then(|w| joint_vector(w.robot(), state)) {
            // Only now it is known how the object is held.
            self.stale |= self.joints.is_none();
            self.joints = Some(joints);
        }
    }

    /// Takes a registered scan, or a newer version of one.
    pub(crate) fn take(&mut self, message: &RegisteredScan) -> Result<()> {
        let held = Held {
            scan: scan_from_message(&message.cloud).map_err(anyhow::Error::msg)?,
            beyond: scan_from_message(&message.beyond).map_err(anyhow::Error::msg)?,
            pose: pose_from_message(&message.object_from_sensor.pose)
                .map_err(anyhow::Error::msg)?,
            status: status_from_message(message.status).map_err(anyhow::Error::msg)?,
        };
        if held.status == Status::Accepted && !self.scans.contains_key(&message.id) && !self.stale {
            self.space.integrate_with(&held.scan, &held.beyond, &held.pose)?;
        } else if held.status == Status::Accepted {
            self.stale = true;
        } else {
            // It shows nothing that can be trusted, but it need not be tried again.
            self.space.mark_used(&held.pose);
        }
        self.scans.insert(message.id, held);
        Ok(())
    }

    /// Takes corrected poses.
    pub(crate) fn correct(&mut self, message: &RegisteredPoses) -> Result<()> {
        for ((id, pose), status) in
            message.ids.iter().zip(&message.object_from_sensor).zip(&message.status)
        {
            if let Some(held) = self.scans.get_mut(id) {
                held.pose = pose_from_message(&pose.pose).map_err(anyhow::Error::msg)?;
                held.status = status_from_message(*status).map_err(anyhow::Error::msg)?;
            }
        }
        self.revision = message.revision;
        self.stale = true;
        Ok(())
    }

    /// Plans the next view from the joint positions `start`, or from where the robot stands.
    pub(crate) fn plan(&mut self, start: &JointState, aim: Aim) -> Result<Answer> {
        self.aim_at(aim);
        self.refresh()?;
        let workcell = self.robot.as_ref().ok_or_else(|| anyhow!("no robot"))?;
        let start = if start.name.is_empty() {
            self.joints.clone().ok_or_else(|| anyhow!("no joint states"))?
        } else {
            joint_vector(workcell.robot(), start)
                .ok_or_else(|| anyhow!("start does not name all joints of the robot"))?
        };
        let sensor = self.params.planner.sensor();
        let obstacle = obstacle(&self.space, &self.params);
        let mut found: Vec<Reached> = Vec::new();
        let on_table = self.params.planner.support == Support::Table;
        let mut reach = |view: &Pose| -> std::result::Result<ReachedView, String> {
            if on_table && view.translation.z <= 0.0 {
                // It reaches farther than the region of interest, where the space could say so.
                return Err("the table hides the object from below".to_owned());
            }
            let request = ReachRequest {
                view: *view,
                start: &start,
                sweep: sensor.sweep(),
                slide: slide_range(&sensor, self.params.planner.distance_share),
                obstacle: &obstacle,
                margin: self.params.planner.margin,
            };
            match workcell.reach(&request).map_err(|error| error.to_string())? {
                Reach::Reached(reached) => {
                    let view = ReachedView {
                        pose: reached.object_from_sensor,
                        duration: reached.duration,
                    };
                    found.push(*reached);
                    Ok(view)
                }
                Reach::Refused { reason } => Err(reason),
            }
        };
        let plan = next_view(&self.space, &mut reach);
        let reached = plan.chosen.as_ref().and_then(|chosen| {
            found.into_iter().find(|reached| reached.object_from_sensor == chosen.pose)
        });
        if let Some(chosen) = &plan.chosen {
            // Whatever becomes of it, it is not planned twice.
            self.space.mark_used(&chosen.pose);
        }
        Ok(Answer { plan, reached, voxel_edge: self.space.edge() })
    }

    fn aim_at(&mut self, aim: Aim) {
        self.stale |= self.aim != aim;
        self.aim = aim;
    }

    /// Makes the space anew if poses or the robot have changed.
    fn refresh(&mut self) -> Result<()> {
        if !self.stale {
            return Ok(());
        }
        let robot = self.robot.as_ref().zip(self.joints.as_deref());
        let mut space = empty_space(&self.params, &self.aim, robot)?;
        for held in self.scans.values() {
            if held.status == Status::Accepted {
                space.integrate_with(&held.scan, &held.beyond, &held.pose)?;
            } else {
                space.mark_used(&held.pose);
            }
        }
        self.space = space;
        self.stale = false;
        Ok(())
    }

    /// Forgets all scans.
    pub(crate) fn reset(&mut self) -> Result<()> {
        self.scans.clear();
        self.revision = 0;
        self.aim = Aim { region: self.params.planner.region(), factor: 1 };
        self.stale = true;
        self.refresh()
    }
}

/// A space in which nothing was seen; what holds the object is set apart.
fn empty_space(
    params: &Params,
    aim: &Aim,
    robot: Option<(&Workcell, &[f64])>,
) -> Result<ViewSpace> {
    let planner = &params.planner;
    let min_points = params.view.min_points.saturating_mul(aim.factor);
    let view = ViewParams { min_points, ..params.view.clone() };
    let mut space = ViewSpace::new(planner.sensor(), aim.region, &view)?;
    if planner.support == Support::Table {
        space.exclude_below(0.0);
    }
    if let Some((workcell, joints)) = robot {
        let bodies = bodies_round_object(workcell.robot(), joints)?;
        space.exclude_where(|point| {
            bodies.iter().any(|(shape, shape_from_object)| {
                shape.distance(&(shape_from_object * Point3::from(*point)).coords) <= 0.0
            })
        });
    }
    Ok(space)
}

/// The bodies that hold the object while the robot stands at `joints`, each with the pose `shape_from_object`.
fn bodies_round_object(robot: &RobotModel, joints: &[f64]) -> Result<Vec<(Shape, Pose)>> {
    let object = robot.link(OBJECT_FRAME)?;
    let holding = robot.holding(object, robot.link(SENSOR_FRAME)?);
    let poses = robot.forward(joints);
    Ok(robot
        .link_shapes()
        .iter()
        .filter(|body| holding.contains(&body.link))
        .map(|body| {
            let object_from_shape =
                poses[object].inverse() * poses[body.link] * body.link_from_shape;
            (body.shape, object_from_shape.inverse())
        })
        .collect())
}

/// The robot's joint vector; none if a joint is not named.
fn joint_vector(robot: &RobotModel, state: &JointState) -> Option<Vec<f64>> {
    let of = |name: &String| {
        let place = state.name.iter().position(|n| n == name)?;
        state.position.get(place).copied().filter(|v| v.is_finite())
    };
    robot.joints().iter().map(|joint| of(&joint.name)).collect()
}

/// What the robot must keep clear of: the box of all that may be the object.
fn obstacle(space: &ViewSpace, params: &Params) -> Obstacle {
    let mut aabb = Aabb::EMPTY;
    for (centre, state, _) in space.voxels() {
        if matches!(state, State::Occupied) {
            aabb.insert(&centre);
        }
    }
    if aabb.diagonal() > 0.0 {
        return Obstacle::of_box(&aabb.padded(space.edge()));
    }
    let radius = UNSEEN_SHARE * params.planner.sensor().working_distance();
    Obstacle::of_sphere(&space.roi().center(), radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::geometry::Vec3;
    use puffer_msgs::geometry_msgs::msg::Vector3;

    #[test]
    fn a_request_bounds_what_views_are_planned_for() {
        let mut desk = Desk::new(Params::default()).unwrap();
        let configured = desk.params.planner.region();
        assert_eq!(*desk.space().roi(), configured);
        let roi = Vector3 { x: 0.1, y: 0.2, z: 0.15 };
        let request = PlanViewRequest { roi, point_factor: 4, ..PlanViewRequest::default() };
        let aim = desk.aim(&request).unwrap();
        assert_eq!(aim.factor, 4);
        desk.aim_at(aim);
        desk.refresh().unwrap();
        let region = *desk.space().roi();
        assert_eq!(region.min, Vec3::new(-0.05, -0.1, configured.min.z));
        assert_eq!(region.max, Vec3::new(0.05, 0.1, 0.15));
        assert!(desk.space().state_at(&Vec3::new(0.06, 0.0, 0.1)).is_none());

        let aim = desk.aim(&PlanViewRequest::default()).unwrap();
        assert_eq!(aim, Aim { region: configured, factor: 1 });
        let roi = Vector3 { x: -0.1, y: 0.2, z: 0.15 };
        let error = desk.aim(&PlanViewRequest { roi, ..PlanViewRequest::default() }).unwrap_err();
        assert!(error.to_string().contains("roi"), "{error}");
        assert!(desk.missing(0, 0).is_some(), "the robot is missing");
    }
}
