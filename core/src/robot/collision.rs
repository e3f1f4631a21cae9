//! Distances between the bodies of the robot, and between them and the object.

use super::chain::Chain;
use super::model::RobotModel;
use crate::geometry::{Aabb, Pose, Shape, Solid, Vec3};

/// What is known of the object's extent: bodies in the object frame that the robot must keep clear of. The bodies
/// that hold the object (gripper, table) may touch it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Obstacle {
    /// Bodies and their poses `object_from_shape`.
    pub shapes: Vec<(Shape, Pose)>,
}

impl Obstacle {
    /// Nothing there.
    pub fn none() -> Obstacle {
        Obstacle::default()
    }

    /// A box in the object frame.
    pub fn of_box(aabb: &Aabb) -> Obstacle {
        let middle = aabb.center();
        let shape = Shape::Box { half: aabb.extent() / 2.0 };
        Obstacle { shapes: vec![(shape, Pose::translation(middle.x, middle.y, middle.z))] }
    }

    /// A sphere in the object frame, metres.
    pub fn of_sphere(middle: &Vec3, radius: f64) -> Obstacle {
        let pose = Pose::translation(middle.x, middle.y, middle.z);
        Obstacle { shapes: vec![(Shape::Sphere { radius }, pose)] }
    }
}

/// A body fixed to a link.
#[derive(Clone, Debug)]
struct Body {
    /// None for the object.
    name: Option<usize>,
    link: usize,
    solid: Solid,
}

/// Bodies and the pairs of them that must stay apart.
#[derive(Clone, Debug)]
pub(crate) struct Collisions {
    bodies: Vec<Body>,
    pairs: Vec<(usize, usize)>,
    /// Links with the same number do not move relative to each other.
    group: Vec<usize>,
    object: usize,
    /// How far a unit of each of the chain's joints moves any point behind it, at most, metres.
    pub rates: Vec<f64>,
}

/// The nearest pair of bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Clearance {
    /// Metres; 0 if they overlap.
    pub distance: f64,
    /// The pair as links; none for the object, and no pair if all are farther than was asked.
    pub pair: Option<(Option<usize>, Option<usize>)>,
}

/// Configurations that a pair must collide in, all of them, to count as touching by design.
const DESIGN_SAMPLES: usize = 200;

impl Collisions {
    /// The pairs of the robot's bodies, without: those that the chain's joints do not move against each other,
    /// parent and child, and those that overlap in all of `samples` (by design).
    pub(crate) fn new(
        robot: &RobotModel,
        chain: &Chain,
        object: usize,
        samples: &[Vec<f64>],
    ) -> Collisions {
        let group = groups(robot, chain);
        let bodies: Vec<Body> = robot
            .shapes
            .iter()
            .map(|s| Body {
                name: Some(s.link),
                link: s.link,
                solid: Solid::new(&s.shape, &s.link_from_shape),
            })
            .collect();
        let related = |a: usize, b: usize| {
            let parent = |l: usize| robot.above[l].map(|e| robot.edges[e].parent);
            parent(a) == Some(b) || parent(b) == Some(a)
        };
        let mut pairs = Vec::new();
        for j in 0..bodies.len() {
            for i in 0..j {
                let (a, b) = (bodies[i].link, bodies[j].link);
                if group[a] != group[b] && !related(a, b) {
                    pairs.push((i, j));
                }
            }
        }
        let mut found = Collisions { bodies, pairs, group, object, rates: Vec::new() };
        found.drop_touching_by_design(robot, samples);
        found.rates = found.rates(robot, chain);
        found
    }

    fn drop_touching_by_design(&mut self, robot: &RobotModel, samples: &[Vec<f64>]) {
        let mut touching = vec![!samples.is_empty(); self.pairs.len()];
        for q in samples.iter().take(DESIGN_SAMPLES) {
            let places = self.places(&robot.forward(q));
            for (touching, &pair) in touching.iter_mut().zip(&self.pairs) {
                *touching = *touching && self.separation(pair, &places) == 0.0;
            }
        }
        let mut at = 0;
        self.pairs.retain(|_| {
            at += 1;
            !touching[at - 1]
        });
    }

    /// With the object's bodies, which must stay clear of all that moves relative to the object.
    pub(crate) fn with(
        &self,
        robot: &RobotModel,
        chain: &Chain,
        obstacle: &Obstacle,
    ) -> Collisions {
        let mut all = self.clone();
        for (shape, pose) in &obstacle.shapes {
            let solid = Solid::new(shape, pose);
            let own = all.bodies.len();
            for (i, body) in self.bodies.iter().enumerate() {
                if self.group[body.link] != self.group[self.object] {
                    all.pairs.push((i, own));
                }
            }
            all.bodies.push(Body { name: None, link: self.object, solid });
        }
        all.rates = all.rates(robot, chain);
        all
    }

    /// The nearest pair for the links' poses; pairs farther than `cap` (metres) are not looked at.
    pub(crate) fn clearance(&self, poses: &[Pose], cap: f64) -> Clearance {
        let places = self.places(poses);
        let mut nearest = Clearance { distance: cap, pair: None };
        for &(i, j) in &self.pairs {
            let apart = places[i].translation.vector - places[j].translation.vector;
            let touching =
                nearest.distance + self.bodies[i].solid.radius() + self.bodies[j].solid.radius();
            if apart.norm_squared() >= touching * touching {
                continue;
            }
            let distance = self.separation((i, j), &places);
            if distance < nearest.distance {
                let pair = Some((self.bodies[i].name, self.bodies[j].name));
                nearest = Clearance { distance, pair };
                if distance == 0.0 {
                    break;
                }
            }
        }
        nearest
    }

    fn places(&self, poses: &[Pose]) -> Vec<Pose> {
        self.bodies.iter().map(|b| b.solid.place(&poses[b.link])).collect()
    }

    fn separation(&self, (i, j): (usize, usize), places: &[Pose]) -> f64 {
        self.bodies[i].solid.separation(&places[i], &self.bodies[j].solid, &places[j])
    }

    /// See [`Collisions::rates`]: lengths down the tree add up to the farthest point from each joint.
    fn rates(&self, robot: &RobotModel, chain: &Chain) -> Vec<f64> {
        let mut reach = vec![0.0f64; robot.link_names.len()];
        for body in &self.bodies {
            reach[body.link] = reach[body.link].max(body.solid.reach());
        }
        let mut rates = vec![0.0f64; robot.joints.len()];
        for edge in robot.edges.iter().rev() {
            let mut farthest = reach[edge.child];
            if let Some(motion) = edge.motion {
                let rate = if motion.slides { 1.0 } else { farthest };
                rates[motion.joint] += rate * motion.factor.abs();
                if motion.slides {
                    let limits = robot.joints[motion.joint].limits;
                    let travel = limits.map(|q| (motion.factor * q + motion.offset).abs());
                    farthest += travel[0].max(travel[1]);
                }
            }
            let length = edge.parent_from_joint.translation.vector.norm();
            reach[edge.parent] = reach[edge.parent].max(length + farthest);
        }
        chain.joints.iter().map(|&j| rates[j]).collect()
    }
}

/// A number for each link, the same for all that the chain's joints do not move against each other.
fn groups(robot: &RobotModel, chain: &Chain) -> Vec<usize> {
    let mut group: Vec<usize> = (0..robot.link_names.len()).collect();
    for edge in &robot.edges {
        if edge.motion.is_none_or(|m| !chain.joints.contains(&m.joint)) {
            group[edge.child] = group[edge.parent];
        }
    }
    group
}
