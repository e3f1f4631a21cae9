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
use puffer_core::view::{Plan, ReachedView, RefusedView, State, ViewParams, ViewSpace, next_view};
use puffer_msgs::msg::{RegisteredPoses, RegisteredScan};
use puffer_msgs::sensor_msgs::msg::JointState;
use puffer_msgs::srv::PlanViewRequest;
use puffer_msgs::std_msgs::msg::Header;
use puffer_shell::Stamp;
use puffer_shell::convert::{
    pose_from_message, region_from_message, scan_from_message, status_from_message,
};
use std::collections::BTreeMap;

/// Before anything was seen, the object is taken to fill a ball of this share of the working distance.
const UNSEEN_SHARE: f64 = 0.4;

/// A joint this near to where it was sent to, radians or metres, is there: finer than what controllers take for reached,
/// coarser than encoders.
const AT_REST: f64 = 0.01;

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
    /// The bodies that hold the object.
    holding: Option<Vec<Body>>,
    /// Whether the space must be made anew, from what is known now.
    stale: bool,
    /// Numbers and versions of the scans that the space was made of, in the order in which it took them.
    made_of: Vec<(u32, u32)>,
    /// The views planned so far.
    planned: Vec<Pose>,
    /// That of the newest corrected poses, 0 without.
    revision: u32,
    /// What the space was made for.
    aim: Aim,
    /// The frame that the scans are registered in.
    frame: String,
}

/// A body and its pose `shape_from_object`.
type Body = (Shape, Pose);

/// What views are planned for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Aim {
    /// The region of interest, object frame, metres.
    pub region: Aabb,
    /// Points that a surface voxel needs, times those configured.
    pub factor: usize,
}

struct Held {
    version: u32,
    scan: Scan,
    beyond: Scan,
    /// What the robot said.
    prior: Pose,
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
        let space = empty_space(&params, &aim, &[])?;
        Ok(Desk {
            params,
            space,
            scans: BTreeMap::new(),
            robot: None,
            description: String::new(),
            fault: None,
            joints: None,
            holding: None,
            stale: false,
            made_of: Vec::new(),
            planned: Vec::new(),
            revision: 0,
            aim,
            frame: OBJECT_FRAME.to_owned(),
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

    /// The header of what is told of the space: its frame is that of the scans, once one came.
    pub(crate) fn header(&self, stamp: Stamp) -> Header {
        Header { stamp: stamp.into(), frame_id: self.frame.clone() }
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

    /// What is missing of the robot, in words.
    pub(crate) fn missing_robot(&self) -> Option<String> {
        if self.robot.is_none() {
            Some("no robot_description came: start the driver or robot_state_publisher".to_owned())
        } else {
            let nowhere = self.joints.is_none();
            nowhere.then(|| "no joint_states for all joints of the robot came".to_owned())
        }
    }

    /// What is missing of the scans that a request names, in words.
    pub(crate) fn missing_scans(&self, request: &PlanViewRequest) -> Option<String> {
        let (scans, revision) = (request.scans as usize, request.revision);
        if self.scans.len() < scans {
            return Some(format!("{} of {scans} scans came", self.scans.len()));
        }
        if self.revision < revision {
            return Some(format!(
                "corrected poses of revision {} of {revision} came",
                self.revision
            ));
        }
        let versions = request.accepted.iter().zip(&request.accepted_versions);
        let mut late = versions
            .filter(|(id, version)| self.scans.get(id).is_none_or(|held| held.version < **version));
        late.next().map(|(id, version)| format!("scan {id} did not come in its version {version}"))
    }

    /// Takes the robot's description; the same one again changes nothing.
    pub(crate) fn describe(&mut self, urdf: &str) -> Result<()> {
        if self.description == urdf {
            return Ok(());
        }
        // Planning goes on with the newest description or none.
        self.description = urdf.to_owned();
        (self.robot, self.joints, self.holding, self.stale) = (None, None, None, true);
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

    /// Whether the robot stands where it was sent to, as far as joint_states say.
    pub(crate) fn stands_at(&self, sent_to: &JointState) -> bool {
        let there = self.robot.as_ref().and_then(|w| joint_vector(w.robot(), sent_to));
        there.zip(self.joints.as_ref()).is_some_and(|(there, joints)| {
            there.iter().zip(joints).all(|(a, b)| (a - b).abs() <= AT_REST)
        })
    }

    /// Takes a registered scan, or a newer version of one; an older one that comes late is passed over.
    pub(crate) fn take(&mut self, message: &RegisteredScan) -> Result<()> {
        if self.scans.get(&message.id).is_some_and(|held| held.version > message.version) {
            return Ok(());
        }
        let held = Held {
            version: message.version,
            scan: scan_from_message(&message.cloud).map_err(anyhow::Error::msg)?,
            beyond: scan_from_message(&message.beyond).map_err(anyhow::Error::msg)?,
            prior: pose_from_message(&message.prior).map_err(anyhow::Error::msg)?,
            pose: pose_from_message(&message.object_from_sensor.pose)
                .map_err(anyhow::Error::msg)?,
            status: status_from_message(message.status).map_err(anyhow::Error::msg)?,
        };
        self.frame.clone_from(&message.header.frame_id);
        let accepted = held.status == Status::Accepted;
        self.scans.insert(message.id, held);
        // The next one is taken in at once, so that a plan need not wait for it; whether it is what the plan is to
        // rest on is seen then.
        let next = self.made_of.last().is_none_or(|(last, _)| *last < message.id);
        if accepted && next && !self.stale { self.integrate(message.id) } else { Ok(()) }
    }

    /// Takes scan `id` into the space.
    fn integrate(&mut self, id: u32) -> Result<()> {
        let Some(held) = self.scans.get(&id) else { return Ok(()) };
        self.space.integrate_with(&held.scan, &held.beyond, &held.pose)?;
        self.made_of.push((id, held.version));
        Ok(())
    }

    /// Takes corrected poses.
    pub(crate) fn correct(&mut self, message: &RegisteredPoses) -> Result<()> {
        let poses = message.ids.iter().zip(&message.object_from_sensor).zip(&message.status);
        for (((id, pose), status), version) in poses.zip(&message.versions) {
            // What was told of a scan later than the poses holds.
            if let Some(held) = self.scans.get_mut(id).filter(|held| held.version <= *version) {
                held.pose = pose_from_message(&pose.pose).map_err(anyhow::Error::msg)?;
                held.status = status_from_message(*status).map_err(anyhow::Error::msg)?;
            }
        }
        self.revision = message.revision;
        self.stale = true;
        Ok(())
    }

    /// Plans the next view. It depends on what the request names, not on what else has come, or when.
    pub(crate) fn plan(&mut self, request: &PlanViewRequest) -> Result<Answer> {
        let aim = self.aim(request)?;
        self.aim_at(aim);
        self.refresh(&self.members(request))?;
        let workcell = self.robot.as_ref().ok_or_else(|| anyhow!("no robot"))?;
        let start = self.start(workcell.robot(), request)?;
        let sensor = self.params.planner.sensor();
        let obstacle = obstacle(&self.space, &self.params);
        let mut found: Vec<Reached> = Vec::new();
        let on_table = self.params.planner.support == Support::Table;
        let mut reach = |view: &Pose| -> std::result::Result<ReachedView, RefusedView> {
            if on_table && view.translation.z <= 0.0 {
                // It reaches farther than the region of interest, where the space could say so.
                let reason = "the table hides the object from below".to_owned();
                return Err(RefusedView { kind: "from below the table", reason });
            }
            let request = ReachRequest {
                view: *view,
                start: &start,
                sweep: sensor.sweep(),
                slide: slide_range(&sensor, self.params.planner.distance_share),
                obstacle: &obstacle,
                margin: self.params.planner.margin,
            };
            let asked = workcell.reach(&request).map_err(|error| RefusedView {
                kind: "that the robot cannot be asked for",
                reason: error.to_string(),
            });
            match asked? {
                Reach::Reached(reached) => {
                    let view = ReachedView {
                        pose: reached.object_from_sensor,
                        duration: reached.duration,
                    };
                    found.push(*reached);
                    Ok(view)
                }
                Reach::Refused { hindrance, reason } => {
                    Err(RefusedView { kind: hindrance.words(), reason })
                }
            }
        };
        let plan = next_view(&self.space, &mut reach);
        let reached = plan.chosen.as_ref().and_then(|chosen| {
            found.into_iter().find(|reached| reached.object_from_sensor == chosen.pose)
        });
        // Whatever becomes of it, it is not planned twice.
        self.planned.extend(plan.chosen.as_ref().map(|chosen| chosen.pose));
        Ok(Answer { plan, reached, voxel_edge: self.space.edge() })
    }

    fn aim_at(&mut self, aim: Aim) {
        self.stale |= self.aim != aim;
        self.aim = aim;
    }

    /// The scans that a plan rests on, ascending: those that the request lists, or all that were accepted.
    fn members(&self, request: &PlanViewRequest) -> Vec<u32> {
        if request.scans_listed {
            return request.accepted.clone();
        }
        let accepted = self.scans.iter().filter(|(_, held)| held.status == Status::Accepted);
        accepted.map(|(id, _)| *id).collect()
    }

    /// Where the way starts.
    fn start(&self, robot: &RobotModel, request: &PlanViewRequest) -> Result<Vec<f64>> {
        if !request.start.name.is_empty() {
            return joint_vector(robot, &request.start)
                .ok_or_else(|| anyhow!("start does not name all joints of the robot"));
        }
        // Joint states come when they come; where it was sent to is the same in each run.
        let sent_to = joint_vector(robot, &request.sent_to);
        sent_to
            .filter(|_| self.stands_at(&request.sent_to))
            .or_else(|| self.joints.clone())
            .ok_or_else(|| anyhow!("no joint states"))
    }

    /// Brings the space to what the scans `members` show, and no others. Scans are taken in by ascending numbers, in
    /// whatever order they came and were accepted.
    fn refresh(&mut self, members: &[u32]) -> Result<()> {
        let version = |id: &u32| Some((*id, self.scans.get(id)?.version));
        let wanted: Vec<(u32, u32)> = members.iter().filter_map(version).collect();
        if self.stale || !wanted.starts_with(&self.made_of) {
            self.clear()?;
        }
        for (id, _) in &wanted[self.made_of.len()..] {
            self.integrate(*id)?;
        }
        // Scans that were not accepted show nothing that can be trusted, but need not be tried again.
        self.space.forget_marks();
        let others = self.scans.values().filter(|held| held.status != Status::Accepted);
        for pose in others.map(|held| &held.prior).chain(&self.planned) {
            self.space.mark_used(pose);
        }
        Ok(())
    }

    /// A space in which nothing was seen yet.
    fn clear(&mut self) -> Result<()> {
        if self.holding.is_none()
            && let Some((workcell, joints)) = self.robot.as_ref().zip(self.joints.as_deref())
        {
            self.holding = Some(bodies_round_object(workcell.robot(), joints)?);
        }
        let holding = self.holding.as_deref().unwrap_or_default();
        self.space = empty_space(&self.params, &self.aim, holding)?;
        self.made_of.clear();
        self.stale = false;
        Ok(())
    }

    /// Forgets all scans.
    pub(crate) fn reset(&mut self) -> Result<()> {
        self.scans.clear();
        self.planned.clear();
        self.revision = 0;
        self.aim = Aim { region: self.params.planner.region(), factor: 1 };
        // The next object may be held otherwise.
        self.holding = None;
        self.clear()
    }
}

/// A space in which nothing was seen; what holds the object is set apart.
fn empty_space(params: &Params, aim: &Aim, holding: &[Body]) -> Result<ViewSpace> {
    let planner = &params.planner;
    let min_points = params.view.min_points.saturating_mul(aim.factor);
    let view = ViewParams { min_points, ..params.view.clone() };
    let mut space = ViewSpace::new(planner.sensor(), aim.region, &view)?;
    if planner.support == Support::Table {
        space.exclude_below(0.0);
    }
    if !holding.is_empty() {
        space.exclude_where(|point| {
            holding.iter().any(|(shape, shape_from_object)| {
                shape.distance(&(shape_from_object * Point3::from(*point)).coords) <= 0.0
            })
        });
    }
    Ok(space)
}

/// The bodies that hold the object while the robot stands at `joints`, each with the pose `shape_from_object`.
fn bodies_round_object(robot: &RobotModel, joints: &[f64]) -> Result<Vec<Body>> {
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
#[path = "desk_tests.rs"]
mod tests;
