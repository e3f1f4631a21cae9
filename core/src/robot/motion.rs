//! Whether a straight motion of the joints is free of collisions, without gaps between the checks: the clearance
//! of one configuration vouches for all that no point can leave it within (Schwarzer, Saha & Latombe 2005,
//! Adaptive dynamic collision checking for single and multiple articulated robots in complex environments).

use super::collision::{Clearance, Collisions};
use super::model::RobotModel;

/// Clearances beyond this are not measured, metres: it bounds the step of a check.
const CAP: f64 = 0.15;
/// Shortest step of a check where the clearance has shrunk to the least allowed, metres.
const SHORTEST: f64 = 1e-3;

/// The robot among its obstacles.
pub(crate) struct Space<'a> {
    pub robot: &'a RobotModel,
    pub collisions: &'a Collisions,
    /// Joints that move, as indices of the robot's.
    pub moving: &'a [usize],
    /// Clearance that a configuration to stop at must have, metres. On the way half of it will do.
    pub margin: f64,
}

impl Space<'_> {
    /// The nearest pair at `q`, as far as it is closer than the margin.
    pub(crate) fn too_close(&self, q: &[f64]) -> Option<Clearance> {
        let clearance = self.collisions.clearance(&self.robot.forward(q), self.margin);
        clearance.pair.map(|_| clearance)
    }

    /// The first pair that comes closer than half the margin on the straight way from `a` to `b`.
    pub(crate) fn blocked(&self, a: &[f64], b: &[f64]) -> Option<Clearance> {
        let way: f64 = self
            .moving
            .iter()
            .zip(&self.collisions.rates)
            .map(|(&j, rate)| (b[j] - a[j]).abs() * rate)
            .sum();
        let floor = self.margin / 2.0;
        let mut done = 0.0;
        loop {
            let q = between(a, b, if way > 0.0 { (done / way).min(1.0) } else { 1.0 });
            let clearance = self.collisions.clearance(&self.robot.forward(&q), CAP);
            if clearance.distance < floor {
                return Some(clearance);
            }
            if done >= way {
                return None;
            }
            done = (done + (clearance.distance - floor).max(SHORTEST)).min(way);
        }
    }

    /// A pair in words.
    pub(crate) fn describe(&self, clearance: &Clearance) -> String {
        let name = |link: Option<usize>| match link {
            Some(link) => format!("`{}`", self.robot.link_names[link]),
            None => "the object".to_owned(),
        };
        match clearance.pair {
            Some((a, b)) => format!("{} and {}", name(a), name(b)),
            None => "nothing".to_owned(),
        }
    }
}

/// The configuration at the share `t` of the straight way; the very end for `t >= 1`.
pub(crate) fn between(a: &[f64], b: &[f64], t: f64) -> Vec<f64> {
    if t >= 1.0 {
        return b.to_vec();
    }
    a.iter().zip(b).map(|(a, b)| a + (b - a) * t).collect()
}
