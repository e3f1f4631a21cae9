//! Time parametrisation of a path: all joints start and stop together on each straight leg, with a
//! trapezoidal velocity profile.

use super::model::RobotModel;
use super::planning_space::interpolate;

/// Time to reach full speed from rest, seconds. Our choice: URDF holds no accelerations.
const ACCELERATION_TIME: f64 = 0.5;
/// Longest time between two points of a trajectory, seconds.
const MAX_POINT_PERIOD: f64 = 0.05;

/// A motion of all joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// Joint positions, radians and metres.
    pub positions: Vec<Vec<f64>>,
    /// The time of each of them, seconds from the start, ascending from 0.
    pub times: Vec<f64>,
}

impl Trajectory {
    /// Time from the first point to the last, seconds.
    pub fn duration(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }

    /// Joint positions at `time` (seconds), interpolated linearly between the points; the last ones
    /// after the end, and `None` for an empty trajectory.
    pub fn positions_at(&self, time: f64) -> Option<Vec<f64>> {
        let next = self.times.partition_point(|t| *t <= time);
        if next == 0 || next == self.times.len() {
            return if next == 0 { self.positions.first() } else { self.positions.last() }.cloned();
        }
        let share = (time - self.times[next - 1]) / (self.times[next] - self.times[next - 1]);
        Some(interpolate(&self.positions[next - 1], &self.positions[next], share))
    }
}

/// The trajectory along straight legs between `corners` that rests at each corner.
pub(crate) fn time_parametrise(robot: &RobotModel, corners: &[Vec<f64>]) -> Trajectory {
    let mut trajectory = Trajectory::default();
    if let Some(first) = corners.first() {
        trajectory.positions.push(first.clone());
        trajectory.times.push(0.0);
    }
    for leg in corners.windows(2) {
        let start = trajectory.duration();
        let cruise_time = robot.min_travel_time(&leg[0], &leg[1]);
        let duration = leg_duration(cruise_time);
        let steps = (duration / MAX_POINT_PERIOD).ceil() as usize;
        for step in 1..=steps {
            let time = duration * step as f64 / steps as f64;
            let share = leg_progress(cruise_time, time);
            trajectory.positions.push(interpolate(&leg[0], &leg[1], share));
            trajectory.times.push(start + time);
        }
    }
    trajectory
}

/// Duration of a leg from rest to rest, seconds; at full speed throughout it would take
/// `cruise_time` seconds.
pub(crate) fn leg_duration(cruise_time: f64) -> f64 {
    if cruise_time >= ACCELERATION_TIME {
        cruise_time + ACCELERATION_TIME
    } else {
        // Full speed is not reached: a triangular profile.
        2.0 * (cruise_time * ACCELERATION_TIME).sqrt()
    }
}

/// Share of a leg that is done `time` seconds after its start.
fn leg_progress(cruise_time: f64, time: f64) -> f64 {
    let duration = leg_duration(cruise_time);
    if time >= duration {
        return 1.0;
    }
    // The unit of length is what full speed covers in a second, so that the speed is at most 1 and
    // the length of the leg is the cruise time.
    let ramp = (duration / 2.0).min(ACCELERATION_TIME);
    let done = if time < ramp {
        accelerated_distance(time)
    } else if time > duration - ramp {
        cruise_time - accelerated_distance(duration - time)
    } else {
        accelerated_distance(ramp) + (time - ramp) * ramp / ACCELERATION_TIME
    };
    done / cruise_time
}

/// The distance covered `time` seconds after a start from rest, in the unit of [`leg_progress`].
fn accelerated_distance(time: f64) -> f64 {
    time * time / (2.0 * ACCELERATION_TIME)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{home_configuration, setup_urdf};

    #[test]
    fn speeds_and_accelerations_keep_their_limits() {
        let robot = RobotModel::from_urdf(setup_urdf("kr16_laser").unwrap()).unwrap();
        let start = home_configuration("kr16_laser").unwrap();
        for (joint, turn) in [(0, 0.01), (1, 0.2), (2, -0.9), (3, 2.0), (5, 5.0)] {
            let mut end = start.clone();
            end[joint] += turn;
            let corners = [start.clone(), end.clone(), start.clone()];
            let trajectory = time_parametrise(&robot, &corners);
            assert_eq!(trajectory.positions.last(), Some(&start));
            let middle = trajectory.positions_at(trajectory.duration() / 2.0).unwrap();
            assert!((middle[joint] - end[joint]).abs() < 1e-9);
            let top = robot.joints()[joint].velocity;
            let speeds: Vec<f64> = (1..trajectory.times.len())
                .map(|i| {
                    let dt = trajectory.times[i] - trajectory.times[i - 1];
                    assert!(dt > 0.0 && dt <= MAX_POINT_PERIOD + 1e-12);
                    (trajectory.positions[i][joint] - trajectory.positions[i - 1][joint]) / dt
                })
                .collect();
            for pair in speeds.windows(2) {
                assert!(pair[0].abs() <= top * (1.0 + 1e-9), "{} above {top}", pair[0]);
                // Mean speeds of neighbouring ticks differ by at most the acceleration times a
                // tick.
                assert!(
                    (pair[1] - pair[0]).abs() <= top / ACCELERATION_TIME * MAX_POINT_PERIOD * 1.01
                );
            }
            if turn > 2.0 * top * ACCELERATION_TIME {
                assert!(speeds.iter().any(|s| *s > 0.99 * top));
            }
        }
    }

    #[test]
    fn legs_have_trapezoidal_or_triangular_velocity_profiles() {
        for cruise_time in [0.01, 0.2, 0.5, 0.7, 3.0] {
            let duration = leg_duration(cruise_time);
            // The length of the leg is the integral of the speed, which is at most 1.
            let steps = 20_000;
            let dt = duration / f64::from(steps);
            let mut length = 0.0;
            for i in 0..steps {
                let time = (f64::from(i) + 0.5) * dt;
                let speed = (time.min(duration - time) / ACCELERATION_TIME).min(1.0);
                length += speed * dt;
                let share = leg_progress(cruise_time, (f64::from(i) + 1.0) * dt);
                assert!((share - length / cruise_time).abs() < 1e-6, "{cruise_time} {time}");
            }
            assert!((length - cruise_time).abs() < 1e-6, "{cruise_time}: {length}");
            assert_eq!(leg_progress(cruise_time, 0.0), 0.0);
            assert_eq!(leg_progress(cruise_time, duration + 1.0), 1.0);
            // Symmetric: what is done after a time is left at that time before the end.
            let (early, late) = (0.3 * duration, 0.7 * duration);
            let sum = leg_progress(cruise_time, early) + leg_progress(cruise_time, late);
            assert!((sum - 1.0).abs() < 1e-12);
        }
        // The two laws meet where full speed is just reached.
        let (below, above) = (leg_duration(0.5 - 1e-9), leg_duration(0.5));
        assert!((below - 1.0).abs() < 1e-8 && above == 1.0);
    }

    #[test]
    fn positions_between_points_are_interpolated_and_kept_beyond_the_ends() {
        let trajectory = Trajectory {
            positions: vec![vec![1.0], vec![3.0], vec![2.0]],
            times: vec![0.0, 0.5, 2.5],
        };
        for (time, expected) in
            [(-1.0, 1.0), (0.0, 1.0), (0.25, 2.0), (0.5, 3.0), (1.5, 2.5), (2.5, 2.0), (9.0, 2.0)]
        {
            let position = trajectory.positions_at(time).unwrap()[0];
            assert!((position - expected).abs() < 1e-12, "{time}: {position}");
        }
        assert_eq!(trajectory.duration(), 2.5);
        assert_eq!(Trajectory::default().positions_at(0.0), None);
        assert_eq!(Trajectory::default().duration(), 0.0);
    }
}
