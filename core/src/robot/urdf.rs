//! Reads a URDF into a checked robot model.

use super::model::{Edge, Joint, JointKind, JointMotion, LinkShape, RobotModel};
use crate::geometry::{Pose, Shape, Vec3};
use crate::{Error, Result};
use nalgebra::{Translation3, Unit, UnitQuaternion};
use urdf_rs::{Geometry, JointType};

/// An axis shorter than this has no direction.
const MIN_AXIS_NORM: f64 = 1e-9;

impl RobotModel {
    /// Reads a plain URDF: revolute, continuous, prismatic, fixed and mimic joints; boxes,
    /// cylinders and spheres as collision bodies.
    ///
    /// # Errors
    /// [`Error::Input`] that names the link or joint: text that is no URDF, links missing, named
    /// twice or in a cycle, more than one root, joints without limits or axis, bodies that are
    /// meshes.
    pub fn from_urdf(text: &str) -> Result<RobotModel> {
        let robot = urdf_rs::read_from_string(text)
            .map_err(|e| Error::input(format!("the robot description is no valid URDF: {e}")))?;
        let link_names: Vec<String> = robot.links.iter().map(|l| l.name.clone()).collect();
        check_unique("link", &link_names)?;
        check_unique("joint", &robot.joints.iter().map(|j| j.name.clone()).collect::<Vec<_>>())?;
        if link_names.is_empty() {
            return Err(Error::input("the robot description has no link"));
        }
        let joints: Vec<Joint> = robot
            .joints
            .iter()
            .filter_map(|j| actuated_joint(j).transpose())
            .collect::<Result<_>>()?;
        let edges: Vec<Edge> = robot
            .joints
            .iter()
            .map(|j| build_edge(j, &robot.joints, &joints, &link_names))
            .collect::<Result<_>>()?;
        let (edges, parent_edge) = sort_edges(edges, &link_names)?;
        let mut shapes = Vec::new();
        for (link, description) in robot.links.iter().enumerate() {
            for body in &description.collision {
                let shape = convert_shape(&body.geometry, &description.name)?;
                shapes.push(LinkShape { link, shape, link_from_shape: convert_pose(&body.origin) });
            }
        }
        Ok(RobotModel { name: robot.name, joints, link_names, shapes, edges, parent_edge })
    }
}

/// Checks that no name occurs twice.
fn check_unique(kind: &str, names: &[String]) -> Result<()> {
    match names.iter().enumerate().find(|(i, name)| names[..*i].contains(name)) {
        Some((_, name)) => {
            Err(Error::input(format!("the {kind} `{name}` is described twice; rename one")))
        }
        None => Ok(()),
    }
}

/// The joint as one that can be commanded; `None` if it is fixed or follows another one.
fn actuated_joint(joint: &urdf_rs::Joint) -> Result<Option<Joint>> {
    let kind = match joint.joint_type {
        JointType::Fixed => return Ok(None),
        _ if joint.mimic.is_some() => return Ok(None),
        JointType::Revolute => JointKind::Revolute,
        JointType::Continuous => JointKind::Continuous,
        JointType::Prismatic => JointKind::Prismatic,
        ref other => {
            return Err(Error::input(format!(
                "the joint `{}` is {other:?}; only revolute, continuous, prismatic and fixed ones are supported",
                joint.name
            )));
        }
    };
    let limit = &joint.limit;
    let limits = match kind {
        JointKind::Continuous => [f64::NEG_INFINITY, f64::INFINITY],
        _ => [limit.lower, limit.upper],
    };
    let bounded = kind == JointKind::Continuous || limits.iter().all(|l| l.is_finite());
    if !(bounded && limits[0] < limits[1] && limit.velocity > 0.0 && limit.velocity.is_finite()) {
        return Err(Error::input(format!(
            "the joint `{}` has no usable limits (lower {}, upper {}, velocity {}): give it a <limit> with lower < \
             upper and a positive velocity",
            joint.name, limit.lower, limit.upper, limit.velocity
        )));
    }
    Ok(Some(Joint { name: joint.name.clone(), kind, limits, velocity: limit.velocity }))
}

fn build_edge(
    joint: &urdf_rs::Joint,
    all: &[urdf_rs::Joint],
    actuated: &[Joint],
    links: &[String],
) -> Result<Edge> {
    let parent = link_of_joint(joint, &joint.parent.link, links)?;
    let child = link_of_joint(joint, &joint.child.link, links)?;
    let motion = match joint.joint_type {
        JointType::Fixed => None,
        _ => Some(build_motion(joint, all, actuated)?),
    };
    Ok(Edge { parent, child, parent_from_joint: convert_pose(&joint.origin), motion })
}

/// Index of the link `name`, which the joint is attached to.
fn link_of_joint(joint: &urdf_rs::Joint, name: &str, links: &[String]) -> Result<usize> {
    links.iter().position(|l| l == name).ok_or_else(|| {
        Error::input(format!(
            "the joint `{}` names the link `{name}`, which is not described",
            joint.name
        ))
    })
}

fn build_motion(
    joint: &urdf_rs::Joint,
    all: &[urdf_rs::Joint],
    actuated: &[Joint],
) -> Result<JointMotion> {
    let axis = Unit::try_new(Vec3::from(*joint.axis.xyz), MIN_AXIS_NORM)
        .ok_or_else(|| Error::input(format!("the joint `{}` has a zero axis", joint.name)))?;
    let (leader, multiplier, offset) = match &joint.mimic {
        None => (joint.name.as_str(), 1.0, 0.0),
        Some(m) => (m.joint.as_str(), m.multiplier.unwrap_or(1.0), m.offset.unwrap_or(0.0)),
    };
    let known = all.iter().any(|j| j.name == leader);
    let Some(index) = actuated.iter().position(|j| j.name == leader) else {
        let why = if known { "is fixed or a mimic itself" } else { "is not described" };
        return Err(Error::input(format!(
            "the joint `{}` mimics `{leader}`, which {why}",
            joint.name
        )));
    };
    let is_prismatic = match joint.joint_type {
        JointType::Revolute | JointType::Continuous => false,
        JointType::Prismatic => true,
        ref other => {
            return Err(Error::input(format!(
                "the mimic joint `{}` is {other:?}: not supported",
                joint.name
            )));
        }
    };
    Ok(JointMotion { axis, is_prismatic, joint: index, multiplier, offset })
}

/// The edges with parents before children, and the edge to the parent of each link.
fn sort_edges(edges: Vec<Edge>, links: &[String]) -> Result<(Vec<Edge>, Vec<Option<usize>>)> {
    let mut has_parent = vec![false; links.len()];
    for edge in &edges {
        if std::mem::replace(&mut has_parent[edge.child], true) {
            return Err(Error::input(format!(
                "the link `{}` hangs on more than one joint; a robot is a tree",
                links[edge.child]
            )));
        }
    }
    let roots: Vec<usize> = (0..links.len()).filter(|&l| !has_parent[l]).collect();
    if let [first, second, ..] = roots[..] {
        return Err(Error::input(format!(
            "the links `{}` and `{}` both have no parent; join them by a (fixed) joint",
            links[first], links[second]
        )));
    }
    let mut order = Vec::with_capacity(edges.len());
    let mut parent_edge = vec![None; links.len()];
    let mut ready = roots;
    while let Some(link) = ready.pop() {
        for edge in edges.iter().filter(|e| e.parent == link) {
            parent_edge[edge.child] = Some(order.len());
            order.push(edge.clone());
            ready.push(edge.child);
        }
    }
    if order.len() < edges.len() {
        let lost = edges.iter().find(|e| parent_edge[e.child].is_none()).map_or(0, |e| e.child);
        return Err(Error::input(format!(
            "the link `{}` is part of a cycle of joints; a robot is a tree with one root",
            links[lost]
        )));
    }
    Ok((order, parent_edge))
}

fn convert_shape(geometry: &Geometry, link: &str) -> Result<Shape> {
    let shape = match geometry {
        Geometry::Box { size } => Shape::Box { half: Vec3::from(**size) / 2.0 },
        Geometry::Cylinder { radius, length } => {
            Shape::Cylinder { radius: *radius, half_length: length / 2.0 }
        }
        Geometry::Sphere { radius } => Shape::Sphere { radius: *radius },
        Geometry::Capsule { .. } | Geometry::Mesh { .. } => {
            return Err(Error::input(format!(
                "the link `{link}` has a mesh or capsule as collision body; use boxes, cylinders and spheres"
            )));
        }
    };
    let sizes = match shape {
        Shape::Box { half } => [half.x, half.y, half.z],
        Shape::Cylinder { radius, half_length } => [radius, half_length, half_length],
        Shape::Sphere { radius } => [radius; 3],
    };
    if sizes.iter().all(|s| *s > 0.0 && s.is_finite()) {
        Ok(shape)
    } else {
        Err(Error::input(format!("the link `{link}` has a collision body without extent")))
    }
}

fn convert_pose(origin: &urdf_rs::Pose) -> Pose {
    let [roll, pitch, yaw] = *origin.rpy;
    Pose::from_parts(
        Translation3::from(Vec3::from(*origin.xyz)),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}
