//! The simulated robot and its sensor: time goes on only while they act.

use crate::outputs::Outputs;
use crate::{DriverParams, Params, motion};
use anyhow::{Context, Result, anyhow};
use puffer_core::geometry::Scan;
use puffer_core::mesh::Mesh;
use puffer_core::mesh::io::{read_mesh, write_cloud, write_mesh};
use puffer_core::robot::{SENSOR_FRAME, Trajectory, description};
use puffer_core::simulate::{Cell, objects};
use puffer_msgs::control_msgs::action::FollowJointTrajectoryGoal;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::std_msgs::msg::Header;
use puffer_shell::bulk::{BulkPublisher, Mode};
use puffer_shell::convert::scan_message;
use puffer_shell::{Node, Stamp};
use std::path::Path;
use std::time::Duration;

/// Time at the start: zero would mean "no time".
const START: Stamp = Stamp::new(1, 0);
/// How long the stereo pair exposes, simulated.
const EXPOSURE: Duration = Duration::from_millis(100);
/// Scans that wait for readers at most.
const SCANS_HELD: usize = 4;

/// The machine. Whoever holds it moves it; nobody else can.
pub(crate) struct Machine {
    cell: Cell,
    params: DriverParams,
    q: Vec<f64>,
    now: Stamp,
    outputs: Outputs,
    points: BulkPublisher,
}

impl Machine {
    pub(crate) fn new(node: &Node<Params>) -> Result<Machine> {
        let params = node.params().driver;
        let cell = load(&params)?;
        let outputs = Outputs::new(node)?;
        outputs.start(cell.robot(), description(params.setup.name())?)?;
        let points = node
            .bulk_publisher_for_all::<PointCloud2>("points", Mode::Queue { depth: SCANS_HELD })?;
        let machine =
            Machine { q: cell.rest().to_vec(), cell, params, now: START, outputs, points };
        machine.write_truth()?;
        machine.tick()?;
        Ok(machine)
    }

    /// Publishes the present once more.
    pub(crate) fn tick(&self) -> Result<()> {
        self.outputs.tick(self.cell.robot(), &self.q, self.now)
    }

    /// The motion that a goal asks for.
    pub(crate) fn plan(
        &self,
        goal: &FollowJointTrajectoryGoal,
    ) -> std::result::Result<Trajectory, motion::Refusal> {
        motion::checked(goal, self.cell.robot(), &self.q)
    }

    /// Moves along `way`, faster than the clock on the wall, until its end or until `stop` says so; whether the end
    /// was reached.
    pub(crate) async fn follow(
        &mut self,
        way: &Trajectory,
        stop: impl Fn() -> bool,
    ) -> Result<bool> {
        let start = self.now;
        let steps = (way.duration() * self.params.rate).ceil().max(1.0) as usize;
        let mut wall = tokio::time::Instant::now();
        for step in 1..=steps {
            if stop() {
                return Ok(false);
            }
            let time = way.duration() * step as f64 / steps as f64;
            self.q = way.at(time).unwrap_or_else(|| self.q.clone());
            self.now = start + Duration::from_secs_f64(time);
            self.tick()?;
            wall += Duration::from_secs_f64(way.duration() / steps as f64 / self.params.speed_up);
            tokio::time::sleep_until(wall).await;
        }
        Ok(true)
    }

    /// Takes a scan where the robot stands and publishes it; the number of points.
    pub(crate) async fn scan(&mut self) -> Result<usize> {
        let middle = self.q.clone();
        let sweep = self.cell.sweep(&middle)?;
        let stamp = match &sweep {
            Some(sweep) => self.sweep(sweep).await?,
            None => {
                self.rest(EXPOSURE).await?;
                let stamp = self.now;
                self.rest(EXPOSURE).await?;
                stamp
            }
        };
        let view = tokio::task::block_in_place(|| self.cell.scan(&middle))?;
        let count = view.scan.returns().count();
        // Whoever was too busy to hear all transforms of the motion gets that of the scan: no pose depends on the load.
        self.outputs.pose(self.cell.robot(), &middle, stamp)?;
        self.points.publish_message(&message(&view.scan, stamp)).await?;
        Ok(count)
    }

    /// Sweeps from one end to the other and comes back to the middle; the time at which the sensor passed it.
    async fn sweep(&mut self, sweep: &Trajectory) -> Result<Stamp> {
        let half = sweep.positions.len() / 2;
        let leg = |range: &[Vec<f64>], times: &[f64]| Trajectory {
            positions: range.to_vec(),
            times: times.iter().map(|t| t - times[0]).collect(),
        };
        let first = leg(&sweep.positions[..=half], &sweep.times[..=half]);
        let second = leg(&sweep.positions[half..], &sweep.times[half..]);
        self.follow(&reversed(&first), || false).await?;
        self.follow(&first, || false).await?;
        let stamp = self.now;
        self.follow(&second, || false).await?;
        self.follow(&reversed(&second), || false).await?;
        Ok(stamp)
    }

    /// Lets time pass at rest.
    async fn rest(&mut self, time: Duration) -> Result<()> {
        self.now = self.now + time;
        self.tick()?;
        tokio::time::sleep(time.div_f64(self.params.speed_up)).await;
        Ok(())
    }

    /// Puts another object before the sensor.
    pub(crate) fn load(&mut self, object: &str) -> Result<()> {
        self.params.object = object.to_owned();
        self.cell = load(&self.params)?;
        self.q = self.cell.rest().to_vec();
        self.write_truth()?;
        self.tick()
    }

    fn write_truth(&self) -> Result<()> {
        let Some(folder) = self.truth_folder() else { return Ok(()) };
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot create the truth folder {}", folder.display()))?;
        Ok(write_mesh(&folder.join("truth.ply"), self.cell.truth(), &[])?)
    }

    /// Writes what the scans saw of the object.
    pub(crate) fn write_seen(&self) -> Result<()> {
        match self.truth_folder() {
            Some(folder) if self.cell.scans() > 0 => {
                Ok(write_cloud(&folder.join("seen.ply"), self.cell.seen(), &[])?)
            }
            _ => Ok(()),
        }
    }

    fn truth_folder(&self) -> Option<&Path> {
        Some(Path::new(&self.params.truth_folder)).filter(|p| !p.as_os_str().is_empty())
    }
}

fn message(scan: &Scan, stamp: Stamp) -> PointCloud2 {
    let (sec, nanosec) = stamp.parts();
    let stamp = puffer_msgs::builtin_interfaces::msg::Time { sec, nanosec };
    scan_message(scan, Header { stamp, frame_id: SENSOR_FRAME.to_owned() })
}

fn reversed(way: &Trajectory) -> Trajectory {
    let end = way.duration();
    Trajectory {
        positions: way.positions.iter().rev().cloned().collect(),
        times: way.times.iter().rev().map(|t| end - t).collect(),
    }
}

fn load(params: &DriverParams) -> Result<Cell> {
    let truth =
        truth(&params.object).with_context(|| format!("driver.object {}", params.object))?;
    Ok(Cell::new(params.setup.name(), truth, params.seed as u64)?)
}

fn truth(object: &str) -> Result<Mesh> {
    let path = Path::new(object);
    if object.is_empty() {
        return Err(anyhow!("is empty; there are {}", objects::names().join(", ")));
    }
    if path.extension().is_none() && !path.exists() {
        return Ok(objects::make(object)?);
    }
    Ok(read_mesh(path)?)
}
