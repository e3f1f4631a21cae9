//! When a path is where: all joints start and stop together in straight legs of trapezoidal speed.

use super::model::RobotModel;
use super::motion::between;

/// Time to reach full speed from rest, seconds. Ours: descriptions hold no accelerations.
const SPEED_UP: f64 = 0.5;
/// Time between two points of a trajectory, seconds.
const TICK: f64 = 0.05;

/// A motion of all joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// Joint vectors, radians and metres.
    pub positions: Vec<Vec<f64>>,
    /// Seconds from the start, ascending from 0.
    pub times: Vec<f64>,
}

impl Trajectory {
    /// Length in time, seconds.
    pub fn duration(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }

    /// Joint positions at `time`, straight between the points; none of an empty trajectory.
    pub fn at(&self, time: f64) -> Option<Vec<f64>> {
        let next = self.times.partition_point(|t| *t <= time);
        if next == 0 || next == self.times.len() {
            return if next == 0 { self.positions.first() } else { self.positions.last() }.cloned();
        }
        let share = (time - self.times[next - 1]) / (self.times[next] - self.times[next - 1]);
        Some(between(&self.positions[next - 1], &self.positions[next], share))
    }
}

/// The trajectory along straight legs between `corners`, at rest at each.
pub(crate) fn parametrised(robot: &RobotModel, corners: &[Vec<f64>]) -> Trajectory {
    let mut trajectory = Trajectory::default();
    if let Some(first) = corners.first() {
        trajectory.positions.push(first.clone());
        trajectory.times.push(0.0);
    }
    for leg in corners.windows(2) {
        let start = trajectory.duration();
        let full = robot.joint_time(&leg[0], &leg[1]);
        let duration = leg_time(full);
        let ticks = (duration / TICK).ceil() as usize;
        for tick in 1..=ticks {
            let time = duration * tick as f64 / ticks as f64;
            trajectory.positions.push(between(&leg[0], &leg[1], share(full, time)));
            trajectory.times.push(start + time);
        }
    }
    trajectory
}

/// Duration of a leg that takes `full` seconds at full speed.
pub(crate) fn leg_time(full: f64) -> f64 {
    if full >= SPEED_UP { full + SPEED_UP } else { 2.0 * (full * SPEED_UP).sqrt() }
}

/// Share of the leg that is done after `time`.
fn share(full: f64, time: f64) -> f64 {
    let duration = leg_time(full);
    if time >= duration {
        return 1.0;
    }
    // In units of the way at full speed for a second; the acceleration is then 1 / SPEED_UP.
    let ramp = (duration / 2.0).min(SPEED_UP);
    let rising = |t: f64| t * t / (2.0 * SPEED_UP);
    let done = if time < ramp {
        rising(time)
    } else if time > duration - ramp {
        full - rising(duration - time)
    } else {
        rising(ramp) + (time - ramp) * ramp / SPEED_UP
    };
    done / full
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{description, home};

    #[test]
    fn speeds_and_accelerations_keep_their_limits() {
        let robot = RobotModel::from_urdf(description("kr16_laser").unwrap()).unwrap();
        let start = home("kr16_laser").unwrap();
        for (joint, turn) in [(0, 0.01), (1, 0.2), (2, -0.9), (3, 2.0), (5, 5.0)] {
            let mut end = start.clone();
            end[joint] += turn;
            let corners = [start.clone(), end.clone(), start.clone()];
            let trajectory = parametrised(&robot, &corners);
            assert_eq!(trajectory.positions.last(), Some(&start));
            let middle = trajectory.at(trajectory.duration() / 2.0).unwrap();
            assert!((middle[joint] - end[joint]).abs() < 1e-9);
            let top = robot.joints()[joint].velocity;
            let speeds: Vec<f64> = (1..trajectory.times.len())
                .map(|i| {
                    let dt = trajectory.times[i] - trajectory.times[i - 1];
                    assert!(dt > 0.0 && dt <= TICK + 1e-12);
                    (trajectory.positions[i][joint] - trajectory.positions[i - 1][joint]) / dt
                })
                .collect();
            for pair in speeds.windows(2) {
                assert!(pair[0].abs() <= top * (1.0 + 1e-9), "{} above {top}", pair[0]);
                // Mean speeds of neighbouring ticks differ by at most the acceleration times a tick.
                assert!((pair[1] - pair[0]).abs() <= top / SPEED_UP * TICK * 1.01);
            }
            if turn > 2.0 * top * SPEED_UP {
                assert!(speeds.iter().any(|s| *s > 0.99 * top));
            }
        }
    }
}
