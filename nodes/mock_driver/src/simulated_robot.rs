//! The simulated robot with its sensor and clock. Time goes on only while they act.

use crate::robot_publishers::RobotPublishers;
use crate::trajectory_goal::{GoalRejection, check_goal};
use crate::{DriverParams, Params};
use anyhow::{Context, Result, anyhow};
use puffer_core::geometry::Scan;
use puffer_core::mesh::Mesh;
use puffer_core::mesh::io::{read_mesh, write_cloud, write_mesh};
use puffer_core::robot::{SENSOR_FRAME, Trajectory, setup_urdf};
use puffer_core::simulate::{SimulatedCell, objects};
use puffer_msgs::control_msgs::action::FollowJointTrajectoryGoal;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::std_msgs::msg::Header;
use puffer_ros::conversions::scan_message;
use puffer_ros::large_data::{LargeDataPublisher, Retention};
use puffer_ros::{Node, Stamp};
use std::ops::Range;
use std::path::Path;
use std::time::Duration;

/// Simulated time at the start. Zero would mean "no time" in ROS.
const START_TIME: Stamp = Stamp::new(1, 0);
/// Simulated time before and after the moment at which the stereo pair takes its images.
const EXPOSURE_TIME: Duration = Duration::from_millis(100);
/// Largest number of scans that wait for their readers.
const MAX_QUEUED_SCANS: usize = 4;

/// The simulated robot. It moves only while its owner lets it, so that nobody moves it twice at
/// once.
pub(crate) struct SimulatedRobot {
    cell: SimulatedCell,
    params: DriverParams,
    /// Joint positions, radians and metres.
    q: Vec<f64>,
    /// Simulated time.
    now: Stamp,
    publishers: RobotPublishers,
    points: LargeDataPublisher,
}

/// How a motion ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MotionEnd {
    /// At the end of its trajectory.
    Completed,
    /// On the way, on request.
    Stopped,
}

impl SimulatedRobot {
    pub(crate) fn new(node: &Node<Params>) -> Result<SimulatedRobot> {
        let params = node.params().driver;
        let cell = make_cell(&params)?;
        let publishers = RobotPublishers::new(node)?;
        publishers.publish_static(cell.robot(), setup_urdf(params.setup.name())?)?;
        let points = node.large_data_publisher_for_any_reader::<PointCloud2>(
            "points",
            Retention::Queue { depth: MAX_QUEUED_SCANS },
        )?;
        let robot = SimulatedRobot {
            q: cell.rest_configuration().to_vec(),
            cell,
            params,
            now: START_TIME,
            publishers,
            points,
        };
        robot.write_truth()?;
        robot.publish_state()?;
        Ok(robot)
    }

    /// Publishes time, joint positions and transforms once more.
    pub(crate) fn publish_state(&self) -> Result<()> {
        self.publishers.publish_state(self.cell.robot(), &self.q, self.now)
    }

    /// The motion of all joints that a goal asks for.
    pub(crate) fn check_goal(
        &self,
        goal: &FollowJointTrajectoryGoal,
    ) -> std::result::Result<Trajectory, GoalRejection> {
        check_goal(goal, self.cell.robot(), &self.q)
    }

    /// Moves along the trajectory, `speed_up` times as fast as the wall clock, until its end or
    /// until `stop` asks for it.
    pub(crate) async fn follow(
        &mut self,
        trajectory: &Trajectory,
        stop: impl Fn() -> bool,
    ) -> Result<MotionEnd> {
        let start = self.now;
        let steps = (trajectory.duration() * self.params.rate).ceil().max(1.0) as usize;
        let mut wall = tokio::time::Instant::now();
        for step in 1..=steps {
            if stop() {
                return Ok(MotionEnd::Stopped);
            }
            let time = trajectory.duration() * step as f64 / steps as f64;
            self.q = trajectory.positions_at(time).unwrap_or_else(|| self.q.clone());
            self.now = start + Duration::from_secs_f64(time);
            self.publish_state()?;
            wall += Duration::from_secs_f64(
                trajectory.duration() / steps as f64 / self.params.speed_up,
            );
            tokio::time::sleep_until(wall).await;
        }
        Ok(MotionEnd::Completed)
    }

    /// Takes a scan at the present pose and publishes it; the number of points.
    pub(crate) async fn scan(&mut self) -> Result<usize> {
        let middle = self.q.clone();
        let sweep = self.cell.sweep(&middle)?;
        let stamp = match &sweep {
            Some(sweep) => self.move_along_sweep(sweep).await?,
            None => {
                self.wait_at_rest(EXPOSURE_TIME).await?;
                let stamp = self.now;
                self.wait_at_rest(EXPOSURE_TIME).await?;
                stamp
            }
        };
        let view = tokio::task::block_in_place(|| self.cell.scan(&middle))?;
        let count = view.scan.returns().count();
        // A reader too busy to receive all transforms of the motion still gets those of the scan,
        // so that no pose depends on the load of the computer.
        self.publishers.publish_transforms(self.cell.robot(), &middle, stamp)?;
        self.points.publish_message(&cloud_message(&view.scan, stamp)).await?;
        Ok(count)
    }

    /// Moves from the middle of the sweep to its start, along it and back to the middle; the time
    /// at which the sensor passed the middle during the sweep.
    async fn move_along_sweep(&mut self, sweep: &Trajectory) -> Result<Stamp> {
        let half = sweep.positions.len() / 2;
        let first = cut_trajectory(sweep, 0..half + 1);
        let second = cut_trajectory(sweep, half..sweep.positions.len());
        self.follow(&reverse_trajectory(&first), || false).await?;
        self.follow(&first, || false).await?;
        let stamp = self.now;
        self.follow(&second, || false).await?;
        self.follow(&reverse_trajectory(&second), || false).await?;
        Ok(stamp)
    }

    /// Lets simulated time pass at rest.
    async fn wait_at_rest(&mut self, time: Duration) -> Result<()> {
        self.now = self.now + time;
        self.publish_state()?;
        tokio::time::sleep(time.div_f64(self.params.speed_up)).await;
        Ok(())
    }

    /// Puts another object in front of the sensor, with the robot at rest.
    pub(crate) fn load_object(&mut self, object: &str) -> Result<()> {
        self.params.object = object.to_owned();
        self.cell = make_cell(&self.params)?;
        self.q = self.cell.rest_configuration().to_vec();
        self.write_truth()?;
        self.publish_state()
    }

    fn write_truth(&self) -> Result<()> {
        let Some(folder) = self.truth_folder() else { return Ok(()) };
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot create the truth folder {}", folder.display()))?;
        Ok(write_mesh(&folder.join("truth.ply"), self.cell.truth(), &[])?)
    }

    /// Writes the points of the object that the scans saw, if there is a folder for the truth.
    pub(crate) fn write_seen_points(&self) -> Result<()> {
        match self.truth_folder() {
            Some(folder) if self.cell.scan_count() > 0 => {
                Ok(write_cloud(&folder.join("seen.ply"), self.cell.seen_points(), &[])?)
            }
            _ => Ok(()),
        }
    }

    fn truth_folder(&self) -> Option<&Path> {
        Some(Path::new(&self.params.truth_folder)).filter(|p| !p.as_os_str().is_empty())
    }
}

fn cloud_message(scan: &Scan, stamp: Stamp) -> PointCloud2 {
    scan_message(scan, Header { stamp: stamp.into(), frame_id: SENSOR_FRAME.to_owned() })
}

/// The points of the trajectory in `range`, with times from 0.
fn cut_trajectory(trajectory: &Trajectory, range: Range<usize>) -> Trajectory {
    let times = &trajectory.times[range.clone()];
    Trajectory {
        positions: trajectory.positions[range].to_vec(),
        times: times.iter().map(|t| t - times[0]).collect(),
    }
}

/// The trajectory from its end to its start.
fn reverse_trajectory(trajectory: &Trajectory) -> Trajectory {
    let end = trajectory.duration();
    Trajectory {
        positions: trajectory.positions.iter().rev().cloned().collect(),
        times: trajectory.times.iter().rev().map(|t| end - t).collect(),
    }
}

/// The set-up with its object.
fn make_cell(params: &DriverParams) -> Result<SimulatedCell> {
    let truth =
        read_object(&params.object).with_context(|| format!("driver.object {}", params.object))?;
    Ok(SimulatedCell::new(params.setup.name(), truth, params.seed as u64)?)
}

/// The mesh of an object that is given by name or as a mesh file, metres.
fn read_object(object: &str) -> Result<Mesh> {
    let path = Path::new(object);
    if object.is_empty() {
        return Err(anyhow!("is empty; there are {}", objects::object_names().join(", ")));
    }
    if path.extension().is_none() && !path.exists() {
        return Ok(objects::make_object(object)?);
    }
    Ok(read_mesh(path)?)
}
