//! Whether a straight motion of the joints is free of collisions, without gaps between the checks:
//! the clearance of one configuration guarantees that all configurations are free in which no point
//! of the robot has moved farther than that (Schwarzer, Saha & Latombe 2005, Adaptive dynamic
//! collision checking for single and multiple articulated robots in complex environments).

use super::collision::{Clearance, CollisionChecker};
use super::model::RobotModel;

/// Clearances beyond this are not measured, metres. It bounds the step between two checks.
const MAX_CLEARANCE: f64 = 0.15;
/// Shortest step between two checks, metres of motion, for where the clearance has shrunk to the
/// least that is allowed.
const MIN_STEP: f64 = 1e-3;

/// The configurations of a robot among its obstacles.
pub(crate) struct PlanningSpace<'a> {
    pub robot: &'a RobotModel,
    pub collisions: &'a CollisionChecker,
    /// Joints that move, as indices of the robot's joints.
    pub active_joints: &'a [usize],
    /// Minimum clearance between bodies in a configuration to stop at, metres. Half of it is
    /// required on the path to it.
    pub margin: f64,
}

impl PlanningSpace<'_> {
    /// The nearest pair of bodies at `q` if it is closer than the margin.
    pub(crate) fn collision_at(&self, q: &[f64]) -> Option<Clearance> {
        let clearance = self.collisions.clearance(&self.robot.forward_kinematics(q), self.margin);
        clearance.pair.map(|_| clearance)
    }

    /// The first pair that comes closer than half the margin on the straight motion from `a` to
    /// `b`.
    pub(crate) fn collision_between(&self, a: &[f64], b: &[f64]) -> Option<Clearance> {
        // No point of the robot moves farther than this, metres.
        let length: f64 = self
            .active_joints
            .iter()
            .zip(&self.collisions.motion_bounds)
            .map(|(&j, bound)| (b[j] - a[j]).abs() * bound)
            .sum();
        let min_clearance = self.margin / 2.0;
        let mut done = 0.0;
        loop {
            let q = interpolate(a, b, if length > 0.0 { (done / length).min(1.0) } else { 1.0 });
            let clearance =
                self.collisions.clearance(&self.robot.forward_kinematics(&q), MAX_CLEARANCE);
            if clearance.distance < min_clearance {
                return Some(clearance);
            }
            if done >= length {
                return None;
            }
            done = (done + (clearance.distance - min_clearance).max(MIN_STEP)).min(length);
        }
    }

    /// The names of the two bodies, for a message.
    pub(crate) fn describe_pair(&self, clearance: &Clearance) -> String {
        match clearance.pair {
            Some((a, b)) => format!("{} and {}", self.describe_body(a), self.describe_body(b)),
            None => "nothing".to_owned(),
        }
    }

    fn describe_body(&self, link: Option<usize>) -> String {
        match link {
            Some(link) => format!("`{}`", self.robot.link_names[link]),
            None => "the object".to_owned(),
        }
    }
}

/// The configuration at the share `t` of the straight motion from `a` to `b`; exactly `b` for
/// `t >= 1`.
pub(crate) fn interpolate(a: &[f64], b: &[f64], t: f64) -> Vec<f64> {
    if t >= 1.0 {
        return b.to_vec();
    }
    a.iter().zip(b).map(|(a, b)| a + (b - a) * t).collect()
}

#[cfg(test)]
mod tests {
    use super::super::collision::Obstacle;
    use super::super::planar_arm_tests::{chain, planar_arm};
    use super::*;
    use crate::geometry::Vec3;

    #[test]
    fn interpolation_is_linear_and_exact_at_its_ends() {
        let (a, b) = ([0.1, -2.0], [0.4, 1.0]);
        assert_eq!(interpolate(&a, &b, 0.0), a);
        assert_eq!(interpolate(&a, &b, 1.0), b);
        assert_eq!(interpolate(&a, &b, 1.5), b);
        let middle = interpolate(&a, &b, 0.5);
        assert!((middle[0] - 0.25).abs() < 1e-15 && (middle[1] + 0.5).abs() < 1e-15);
    }

    #[test]
    fn a_motion_is_blocked_where_dense_sampling_finds_a_collision() {
        let robot = planar_arm();
        let chain = chain(&robot);
        let object = robot.link("object").unwrap();
        let collisions = CollisionChecker::new(&robot, &chain, object, &[]);
        // A thin ball that the ball at the tip can pass only narrowly.
        let obstacle = Obstacle::from_sphere(&Vec3::new(0.0, 0.7, 0.0), 0.001);
        let collisions = collisions.with_obstacle(&robot, &chain, &obstacle);
        let space = PlanningSpace {
            robot: &robot,
            collisions: &collisions,
            active_joints: &chain.joints,
            margin: 0.01,
        };
        let (mut blocked, mut free) = (0, 0);
        for elbow in [0.0, 0.2, 0.5, 0.8, 1.0, 1.2, 1.6] {
            let (a, b) = ([0.2, elbow], [2.8, elbow]);
            let nearest = (0..=2000)
                .map(|i| {
                    let q = interpolate(&a, &b, f64::from(i) / 2000.0);
                    collisions.clearance(&robot.forward_kinematics(&q), 1.0).distance
                })
                .fold(f64::INFINITY, f64::min);
            // Half the margin is required; the dense sampling errs by less than 0.2 mm.
            if nearest < 0.005 - 1e-3 {
                assert!(space.collision_between(&a, &b).is_some(), "{elbow}: {nearest}");
                blocked += 1;
            } else if nearest > 0.005 + 1e-3 {
                assert_eq!(space.collision_between(&a, &b), None, "{elbow}: {nearest}");
                free += 1;
            }
        }
        assert!(blocked >= 2 && free >= 2, "{blocked} {free}");
    }
}
