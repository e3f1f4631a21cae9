//! The planner's state, and how a request becomes a plan.

use super::known_bodies::{FixtureBody, Target, empty_space, fixture_bodies, object_obstacle};
use super::params::PlannerParams;
use super::reach_query::ReachQuery;
use super::request::{
    JointPositions, PlanRequest, PlanningResult, PoseUpdate, Readiness, ScanUpdate, ScanVersion,
};
use super::robot_state::RobotState;
use super::scan_store::ScanStore;
use crate::geometry::Pose;
use crate::robot::{OBJECT_FRAME, slide_range};
use crate::scan::Support;
use crate::view::{ViewParams, ViewSpace, next_view};
use crate::{Error, Result};

/// The view planner of a robot cell. It takes scans, corrected poses, the robot description and
/// joint positions in any order, and plans views from them.
pub struct Planner {
    params: PlannerParams,
    view_params: ViewParams,
    space: ViewSpace,
    scans: ScanStore,
    robot: RobotState,
    /// The bodies that hold the object, once the robot and its joint positions are known.
    fixture: Option<Vec<FixtureBody>>,
    /// Whether the space must be rebuilt from what is known now.
    is_space_stale: bool,
    /// The scans that the space was made of, in the order in which they were integrated.
    integrated: Vec<ScanVersion>,
    /// The views planned so far, `object_from_sensor`.
    planned: Vec<Pose>,
    /// What the space was made for.
    target: Target,
    /// Name of the frame that the scans are registered in.
    frame: String,
}

impl Planner {
    /// A planner that knows no scans and no robot.
    ///
    /// # Errors
    /// As [`ViewSpace::new`].
    pub fn new(params: PlannerParams, view_params: ViewParams) -> Result<Planner> {
        let target = Target { region: params.region(), point_factor: 1 };
        Ok(Planner {
            space: empty_space(&params, &view_params, &target, &[])?,
            params,
            view_params,
            scans: ScanStore::default(),
            robot: RobotState::default(),
            fixture: None,
            is_space_stale: false,
            integrated: Vec::new(),
            planned: Vec::new(),
            target,
            frame: OBJECT_FRAME.to_owned(),
        })
    }

    /// Number of scans that have arrived.
    pub fn scan_count(&self) -> usize {
        self.scans.len()
    }

    /// Names of the robot's joints; empty without a robot.
    pub fn joint_names(&self) -> Vec<String> {
        self.robot.joint_names()
    }

    /// What is known of the space.
    pub fn space(&self) -> &ViewSpace {
        &self.space
    }

    /// Name of the frame that the space and all views are expressed in: that of the newest scan.
    pub fn frame(&self) -> &str {
        &self.frame
    }

    /// What the space is made for: the target of the newest request.
    pub fn target(&self) -> &Target {
        &self.target
    }

    /// Takes the robot description (URDF); the same one again changes nothing. Planning goes on
    /// with the newest description or none.
    ///
    /// # Errors
    /// [`Error::Input`] with what is wrong with the description.
    pub fn on_robot_description(&mut self, urdf: &str) -> Result<()> {
        if self.robot.has_description(urdf) {
            return Ok(());
        }
        (self.fixture, self.is_space_stale) = (None, true);
        self.robot.load(urdf)
    }

    /// Takes joint positions; joints that the robot does not have are ignored.
    pub fn on_joint_state(&mut self, positions: &JointPositions) {
        let were_unknown = self.robot.joints().is_none();
        if self.robot.set_joints(positions) {
            // The pose of the fixture relative to the object is known only now.
            self.is_space_stale |= were_unknown;
        }
    }

    /// Takes a registered scan, or a newer version of one; an older version that arrives late is
    /// ignored.
    ///
    /// # Errors
    /// As [`ViewSpace::integrate_with_beyond`].
    pub fn on_scan(&mut self, update: ScanUpdate) -> Result<()> {
        if self.scans.is_superseded(update.version) {
            return Ok(());
        }
        let (id, accepted) = (update.version.id, update.status.is_accepted());
        self.frame.clone_from(&update.frame);
        self.scans.insert(update);
        // The next accepted scan is integrated at once, so that a plan need not wait for it.
        // Whether a plan rests on it is decided by the request.
        let is_next = self.integrated.last().is_none_or(|last| last.id < id);
        if accepted && is_next && !self.is_space_stale { self.integrate(id) } else { Ok(()) }
    }

    /// Takes the corrected poses of a revision.
    pub fn on_corrected_poses(&mut self, revision: u32, updates: &[PoseUpdate]) {
        self.scans.correct_poses(revision, updates);
        self.is_space_stale = true;
    }

    /// Whether the inputs of `request` have arrived.
    pub fn readiness(&self, request: &PlanRequest) -> Readiness {
        if let Some(error) = self.robot.error() {
            return Readiness::RobotUnusable(error.to_owned());
        }
        if let Some(missing) = self.scans.missing(request) {
            return Readiness::ScansMissing(missing);
        }
        self.robot.missing().map_or(Readiness::Ready, Readiness::RobotMissing)
    }

    /// Whether the robot is at `goal`, according to the newest joint positions.
    pub fn is_at(&self, goal: &JointPositions) -> bool {
        self.robot.is_at(goal)
    }

    /// Plans the next view. The plan depends on what the request names, not on what else has
    /// arrived.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no robot, the start is unknown, or a scan cannot be integrated.
    pub fn plan(&mut self, request: &PlanRequest) -> Result<PlanningResult> {
        let point_factor = request.point_factor.max(1);
        self.set_target(Target { region: request.region, point_factor });
        self.refresh(&self.members(request))?;
        let workcell = self.robot.workcell().ok_or_else(|| Error::input("no robot"))?;
        let start = self.robot.start(request)?;
        let sensor = self.params.sensor();
        let mut query = ReachQuery {
            workcell,
            start: &start,
            obstacle: &object_obstacle(&self.space, &self.params),
            sweep: sensor.sweep_length(),
            slide: slide_range(&sensor, self.params.distance_share),
            margin: self.params.margin,
            on_table: self.params.support == Support::Table,
            found: Vec::new(),
        };
        let plan = next_view(&self.space, &mut |view| query.ask(view));
        let motion = plan.chosen.as_ref().and_then(|chosen| query.take_motion(&chosen.pose));
        // Whatever becomes of the view, it is not planned again.
        self.planned.extend(plan.chosen.as_ref().map(|chosen| chosen.pose));
        Ok(PlanningResult { plan, motion, voxel_edge: self.space.edge() })
    }

    /// Forgets all scans and planned views.
    ///
    /// # Errors
    /// As [`ViewSpace::new`].
    pub fn reset(&mut self) -> Result<()> {
        self.scans.clear();
        self.planned.clear();
        self.target = Target { region: self.params.region(), point_factor: 1 };
        // The next object may be held in another way.
        self.fixture = None;
        self.clear_space()
    }

    fn set_target(&mut self, target: Target) {
        self.is_space_stale |= self.target != target;
        self.target = target;
    }

    /// The scans that a plan rests on, ascending: those that the request lists, or all accepted
    /// ones.
    fn members(&self, request: &PlanRequest) -> Vec<u32> {
        request.members.clone().unwrap_or_else(|| self.scans.accepted())
    }

    /// Brings the space to what the scans `members` show, and no others. Scans are integrated by
    /// ascending number, in whatever order they arrived and were accepted.
    fn refresh(&mut self, members: &[u32]) -> Result<()> {
        let wanted = self.scans.versions(members);
        if self.is_space_stale || !wanted.starts_with(&self.integrated) {
            self.clear_space()?;
        }
        for scan in &wanted[self.integrated.len()..] {
            self.integrate(scan.id)?;
        }
        // Scans that were not accepted add nothing to the space, but their views are not repeated.
        self.space.forget_marks();
        for pose in self.scans.unaccepted_priors().chain(&self.planned) {
            self.space.mark_used(pose);
        }
        Ok(())
    }

    /// Integrates scan `id` into the space.
    fn integrate(&mut self, id: u32) -> Result<()> {
        let Some(stored) = self.scans.get(id) else { return Ok(()) };
        self.space.integrate_with_beyond(&stored.scan, &stored.beyond, &stored.pose)?;
        self.integrated.push(ScanVersion { id, version: stored.version });
        Ok(())
    }

    /// Replaces the space by one in which nothing was seen.
    fn clear_space(&mut self) -> Result<()> {
        if self.fixture.is_none()
            && let Some((workcell, joints)) = self.robot.workcell().zip(self.robot.joints())
        {
            self.fixture = Some(fixture_bodies(workcell.robot(), joints)?);
        }
        let fixture = self.fixture.as_deref().unwrap_or_default();
        self.space = empty_space(&self.params, &self.view_params, &self.target, fixture)?;
        self.integrated.clear();
        self.is_space_stale = false;
        Ok(())
    }
}

#[cfg(test)]
#[path = "view_planner_tests.rs"]
mod tests;
