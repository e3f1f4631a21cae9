//! Relations between the links of the kinematic tree.

use super::model::RobotModel;

impl RobotModel {
    /// The parent of `link`, and whether a joint moves one against the other; `None` for the root.
    pub fn parent_link(&self, link: usize) -> Option<(usize, bool)> {
        let edge = &self.edges[self.parent_edge[link]?];
        Some((edge.parent, edge.motion.is_some()))
    }

    /// The links that are rigidly attached to `link`, itself among them, in the order of the
    /// description.
    pub fn links_rigid_with(&self, link: usize) -> Vec<usize> {
        let root = self.rigid_root(link);
        (0..self.link_names.len()).filter(|&l| self.rigid_root(l) == root).collect()
    }

    /// The links that do not move relative to `link` however the joints between `link` and `other`
    /// move, in the order of the description. These are the links that hold `link`, including jaws
    /// that have joints of their own.
    pub fn links_holding(&self, link: usize, other: usize) -> Vec<usize> {
        let mut moving = self.edges_between(link, other);
        moving.retain(|&edge| self.edges[edge].motion.is_some());
        (0..self.link_names.len())
            .filter(|&l| self.edges_between(link, l).iter().all(|edge| !moving.contains(edge)))
            .collect()
    }

    /// The edges on the path between two links.
    fn edges_between(&self, a: usize, b: usize) -> Vec<usize> {
        let (mut up, mut down) = (self.edges_to_root(a), self.edges_to_root(b));
        let above_a = up.clone();
        up.retain(|edge| !down.contains(edge));
        down.retain(|edge| !above_a.contains(edge));
        [up, down].concat()
    }

    /// The edges from `link` up to the root.
    pub(super) fn edges_to_root(&self, mut link: usize) -> Vec<usize> {
        let mut edges = Vec::new();
        while let Some(edge) = self.parent_edge[link] {
            edges.push(edge);
            link = self.edges[edge].parent;
        }
        edges
    }

    /// The link nearest to the root that `link` is rigidly attached to.
    fn rigid_root(&self, mut link: usize) -> usize {
        while let Some((parent, false)) = self.parent_link(link) {
            link = parent;
        }
        link
    }
}

#[cfg(test)]
mod tests {
    use crate::robot::{RobotModel, setup_urdf};

    fn robot(setup: &str) -> RobotModel {
        RobotModel::from_urdf(setup_urdf(setup).unwrap()).unwrap()
    }

    fn names<'a>(robot: &'a RobotModel, links: &[usize]) -> Vec<&'a str> {
        links.iter().map(|&link| robot.link_names()[link].as_str()).collect()
    }

    #[test]
    fn the_striper_moves_with_the_flange_and_the_object_with_the_table() {
        let robot = robot("kr16_laser");
        let [sensor, object, base, link_1, world] =
            ["sensor_optical", "object", "base_link", "link_1", "world"]
                .map(|name| robot.link(name).unwrap());
        assert_eq!(
            names(&robot, &robot.links_rigid_with(sensor)),
            ["link_6", "flange", "bracket", "sensor", "sensor_optical"]
        );
        assert_eq!(
            names(&robot, &robot.links_rigid_with(object)),
            ["world", "base_link", "table", "object"]
        );
        assert_eq!(robot.parent_link(link_1), Some((base, true)));
        assert_eq!(robot.parent_link(world), None);
    }

    #[test]
    fn jaws_hold_the_object_and_the_arm_behind_them_does_not() {
        let robot = robot("omnirob_stereo");
        let [object, sensor] = ["object", "sensor_optical"].map(|name| robot.link(name).unwrap());
        assert_eq!(
            names(&robot, &robot.links_holding(object, sensor)),
            ["lwr_link_7", "flange", "gripper", "gripper_left", "gripper_right", "object"]
        );
    }

    #[test]
    fn rigid_links_keep_their_pose_and_others_do_not() {
        let robot = robot("omnirob_stereo");
        let zero = vec![0.0; robot.joints().len()];
        let bent: Vec<f64> = robot.joints().iter().map(|j| 0.1 * j.limits[1].min(1.0)).collect();
        let [at_zero, at_bent] = [zero, bent].map(|q| robot.forward_kinematics(&q));
        for link in 0..robot.link_names().len() {
            let rigid = robot.links_rigid_with(link);
            for other in 0..robot.link_names().len() {
                let [before, after] =
                    [&at_zero, &at_bent].map(|poses| poses[link].inverse() * poses[other]);
                let moved = (before.inverse() * after).to_homogeneous();
                let is_still = (moved - nalgebra::Matrix4::identity()).norm() < 1e-12;
                assert_eq!(rigid.contains(&other), is_still, "{link} {other}");
            }
        }
    }
}
