//! Distances between the bodies of the robot, and between them and the object.

use super::kinematic_chain::KinematicChain;
use super::model::RobotModel;
use crate::geometry::{Aabb, Pose, Shape, Solid, Vec3};

/// What is known of the object's extent: bodies in the object frame that the robot must keep clear
/// of. The bodies that hold the object (gripper, table) may touch it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Obstacle {
    /// Bodies and their poses `object_from_shape`.
    pub shapes: Vec<(Shape, Pose)>,
}

impl Obstacle {
    /// An obstacle without bodies.
    pub fn empty() -> Obstacle {
        Obstacle::default()
    }

    /// A box in the object frame, metres.
    pub fn from_box(aabb: &Aabb) -> Obstacle {
        let center = aabb.center();
        let shape = Shape::Box { half: aabb.extent() / 2.0 };
        Obstacle { shapes: vec![(shape, Pose::translation(center.x, center.y, center.z))] }
    }

    /// A sphere in the object frame, metres.
    pub fn from_sphere(center: &Vec3, radius: f64) -> Obstacle {
        let pose = Pose::translation(center.x, center.y, center.z);
        Obstacle { shapes: vec![(Shape::Sphere { radius }, pose)] }
    }
}

/// A body that is fixed to a link.
#[derive(Clone, Debug)]
struct CollisionBody {
    /// The link of the robot that the body is a part of; `None` for a body of the object.
    owner: Option<usize>,
    link: usize,
    solid: Solid,
}

/// The bodies of the robot and of the object, and the pairs of them that must keep apart.
#[derive(Clone, Debug)]
pub(crate) struct CollisionChecker {
    bodies: Vec<CollisionBody>,
    pairs: Vec<(usize, usize)>,
    /// A number for each link. Links with the same number do not move relative to each other.
    rigid_groups: Vec<usize>,
    object_link: usize,
    /// Upper bound for the path of any point behind each of the chain's joints, metres per unit of
    /// the joint.
    pub motion_bounds: Vec<f64>,
}

/// The nearest pair of bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Clearance {
    /// Distance of the pair, metres; 0 if the bodies overlap.
    pub distance: f64,
    /// The links of the two bodies, with `None` for the object. There is no pair if all bodies are
    /// farther apart than was asked.
    pub pair: Option<(Option<usize>, Option<usize>)>,
}

/// Number of configurations in all of which two bodies must overlap to count as touching by design.
const PERMANENT_CONTACT_SAMPLES: usize = 200;

impl CollisionChecker {
    /// The pairs of the robot's bodies, except those that the chain's joints do not move against
    /// each other, those of parent and child, and those that overlap in all of `samples` (joint
    /// positions) and so touch by design.
    pub(crate) fn new(
        robot: &RobotModel,
        chain: &KinematicChain,
        object_link: usize,
        samples: &[Vec<f64>],
    ) -> CollisionChecker {
        let rigid_groups = rigid_groups(robot, chain);
        let bodies: Vec<CollisionBody> = robot
            .shapes
            .iter()
            .map(|s| CollisionBody {
                owner: Some(s.link),
                link: s.link,
                solid: Solid::new(&s.shape, &s.link_from_shape),
            })
            .collect();
        let mut pairs = Vec::new();
        for j in 0..bodies.len() {
            for i in 0..j {
                let (a, b) = (bodies[i].link, bodies[j].link);
                if rigid_groups[a] != rigid_groups[b] && !are_adjacent(robot, a, b) {
                    pairs.push((i, j));
                }
            }
        }
        let motion_bounds = Vec::new();
        let mut checker =
            CollisionChecker { bodies, pairs, rigid_groups, object_link, motion_bounds };
        checker.drop_permanent_contacts(robot, samples);
        checker.motion_bounds = checker.compute_motion_bounds(robot, chain);
        checker
    }

    fn drop_permanent_contacts(&mut self, robot: &RobotModel, samples: &[Vec<f64>]) {
        let mut touching = vec![!samples.is_empty(); self.pairs.len()];
        for q in samples.iter().take(PERMANENT_CONTACT_SAMPLES) {
            let poses = self.body_poses(&robot.forward_kinematics(q));
            for (touching, &pair) in touching.iter_mut().zip(&self.pairs) {
                *touching = *touching && self.pair_distance(pair, &poses) == 0.0;
            }
        }
        let mut index = 0;
        self.pairs.retain(|_| {
            index += 1;
            !touching[index - 1]
        });
    }

    /// The same with the object's bodies, which must keep clear of all bodies that move relative to
    /// the object.
    pub(crate) fn with_obstacle(
        &self,
        robot: &RobotModel,
        chain: &KinematicChain,
        obstacle: &Obstacle,
    ) -> CollisionChecker {
        let mut all = self.clone();
        for (shape, pose) in &obstacle.shapes {
            let solid = Solid::new(shape, pose);
            let own = all.bodies.len();
            for (i, body) in self.bodies.iter().enumerate() {
                if self.rigid_groups[body.link] != self.rigid_groups[self.object_link] {
                    all.pairs.push((i, own));
                }
            }
            all.bodies.push(CollisionBody { owner: None, link: self.object_link, solid });
        }
        all.motion_bounds = all.compute_motion_bounds(robot, chain);
        all
    }

    /// The nearest pair of bodies for the poses of all links; pairs farther apart than
    /// `max_distance` (metres) are left out.
    pub(crate) fn clearance(&self, link_poses: &[Pose], max_distance: f64) -> Clearance {
        let poses = self.body_poses(link_poses);
        let mut nearest = Clearance { distance: max_distance, pair: None };
        for &(i, j) in &self.pairs {
            let apart = poses[i].translation.vector - poses[j].translation.vector;
            let touching = nearest.distance
                + self.bodies[i].solid.bounding_radius()
                + self.bodies[j].solid.bounding_radius();
            if apart.norm_squared() >= touching * touching {
                continue;
            }
            let distance = self.pair_distance((i, j), &poses);
            if distance < nearest.distance {
                let pair = Some((self.bodies[i].owner, self.bodies[j].owner));
                nearest = Clearance { distance, pair };
                if distance == 0.0 {
                    break;
                }
            }
        }
        nearest
    }

    fn body_poses(&self, link_poses: &[Pose]) -> Vec<Pose> {
        self.bodies.iter().map(|b| b.solid.body_pose(&link_poses[b.link])).collect()
    }

    fn pair_distance(&self, (i, j): (usize, usize), poses: &[Pose]) -> f64 {
        self.bodies[i].solid.separation(&poses[i], &self.bodies[j].solid, &poses[j])
    }

    /// See [`CollisionChecker::motion_bounds`]. The lengths of the edges down the tree add up to
    /// the distance of the farthest point from each joint.
    fn compute_motion_bounds(&self, robot: &RobotModel, chain: &KinematicChain) -> Vec<f64> {
        // Distance of the farthest point on or behind each link from the link's frame.
        let mut reach = vec![0.0f64; robot.link_names.len()];
        for body in &self.bodies {
            reach[body.link] = reach[body.link].max(body.solid.max_reach());
        }
        let mut bounds = vec![0.0f64; robot.joints.len()];
        for edge in robot.edges.iter().rev() {
            let mut farthest = reach[edge.child];
            if let Some(motion) = edge.motion {
                let rate = if motion.is_prismatic { 1.0 } else { farthest };
                bounds[motion.joint] += rate * motion.multiplier.abs();
                if motion.is_prismatic {
                    let limits = robot.joints[motion.joint].limits;
                    let travel = limits.map(|q| (motion.multiplier * q + motion.offset).abs());
                    farthest += travel[0].max(travel[1]);
                }
            }
            let length = edge.parent_from_joint.translation.vector.norm();
            reach[edge.parent] = reach[edge.parent].max(length + farthest);
        }
        chain.joint_positions(&bounds)
    }
}

/// Whether one of the links is the parent of the other.
fn are_adjacent(robot: &RobotModel, a: usize, b: usize) -> bool {
    let [parent_of_a, parent_of_b] = [a, b].map(|link| robot.parent_link(link).map(|p| p.0));
    parent_of_a == Some(b) || parent_of_b == Some(a)
}

/// A number for each link, the same for all links that the chain's joints do not move against each
/// other.
fn rigid_groups(robot: &RobotModel, chain: &KinematicChain) -> Vec<usize> {
    let mut groups: Vec<usize> = (0..robot.link_names.len()).collect();
    for edge in &robot.edges {
        if edge.motion.is_none_or(|m| !chain.joints.contains(&m.joint)) {
            groups[edge.child] = groups[edge.parent];
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::super::planar_arm_tests::{chain, planar_arm};
    use super::*;
    use crate::robot::{home_configuration, setup_urdf};

    #[test]
    fn the_clearance_of_two_spheres_is_computed_by_hand() {
        let robot = planar_arm();
        let chain = chain(&robot);
        let [object, upper, sensor] =
            ["object", "upper", "sensor_optical"].map(|name| robot.link(name).unwrap());
        let checker = CollisionChecker::new(&robot, &chain, object, &[]);
        // Folded back by a right angle, the tip is 0.2 m along and 0.3 m beside the middle of the
        // upper link.
        let poses = robot.forward_kinematics(&[0.4, std::f64::consts::FRAC_PI_2]);
        let clearance = checker.clearance(&poses, 1.0);
        let expected = 0.2f64.hypot(0.3) - 0.02 - 0.05;
        assert!((clearance.distance - expected).abs() < 1e-9, "{clearance:?}");
        assert_eq!(clearance.pair, Some((Some(upper), Some(sensor))));
        let capped = checker.clearance(&poses, 0.1);
        assert_eq!(capped, Clearance { distance: 0.1, pair: None });
        // With an obstacle that overlaps the tip.
        let tip = poses[sensor].translation.vector;
        let obstacle = Obstacle::from_box(&Aabb { min: tip, max: tip + Vec3::repeat(0.1) });
        let clearance = checker.with_obstacle(&robot, &chain, &obstacle).clearance(&poses, 1.0);
        assert_eq!((clearance.distance, clearance.pair), (0.0, Some((Some(sensor), None))));
    }

    #[test]
    fn the_clearance_is_the_least_distance_of_all_pairs_by_brute_force() {
        let robot = RobotModel::from_urdf(setup_urdf("kr16_laser").unwrap()).unwrap();
        let chain = chain(&robot);
        let object = robot.link("object").unwrap();
        let checker = CollisionChecker::new(&robot, &chain, object, &[]);
        let home = home_configuration("kr16_laser").unwrap();
        for step in 0..12 {
            let mut q = home.clone();
            q[step % 6] += 0.15 * step as f64;
            let link_poses = robot.forward_kinematics(&q);
            let poses = checker.body_poses(&link_poses);
            let nearest = checker
                .pairs
                .iter()
                .map(|&pair| checker.pair_distance(pair, &poses))
                .fold(f64::INFINITY, f64::min);
            let clearance = checker.clearance(&link_poses, 10.0);
            assert!((clearance.distance - nearest).abs() < 1e-9, "{clearance:?} {nearest}");
        }
    }

    #[test]
    fn no_point_moves_faster_than_the_motion_bounds() {
        let robot = planar_arm();
        let chain = chain(&robot);
        let object = robot.link("object").unwrap();
        let checker = CollisionChecker::new(&robot, &chain, object, &[]);
        // The farthest point of the ball at the tip is 0.75 m from the shoulder and 0.35 m from the
        // elbow.
        for (bound, expected) in checker.motion_bounds.iter().zip([0.75, 0.35]) {
            assert!((bound - expected).abs() < 1e-12, "{bound} {expected}");
        }
    }

    #[test]
    fn bodies_that_always_touch_are_no_collision() {
        let robot = planar_arm();
        let chain = chain(&robot);
        let object = robot.link("object").unwrap();
        // With the elbow folded the tip's ball does not reach the ball of the upper link; with a
        // straight arm neither does it, so the pair stays. Samples that all overlap would drop it.
        let apart = CollisionChecker::new(&robot, &chain, object, &[vec![0.0, 0.0]]);
        assert_eq!(apart.pairs.len(), 1);
        let mut near = robot.clone();
        near.shapes[0].shape = Shape::Sphere { radius: 0.6 };
        let touching = CollisionChecker::new(&near, &chain, object, &[vec![0.0, 0.0]]);
        assert!(touching.pairs.is_empty());
    }
}
