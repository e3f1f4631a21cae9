//! Who hangs on whom.

use super::model::RobotModel;

impl RobotModel {
    /// The link that carries `link`, and whether a joint moves between them; none for the root.
    pub fn carrier(&self, link: usize) -> Option<(usize, bool)> {
        let edge = &self.edges[self.above[link]?];
        Some((edge.parent, edge.motion.is_some()))
    }

    /// The links that never move against `link`, itself among them, in the order of the description.
    pub fn rigid_with(&self, link: usize) -> Vec<usize> {
        let root = self.fixed_root(link);
        (0..self.link_names.len()).filter(|&l| self.fixed_root(l) == root).collect()
    }

    /// The links that stay still against `link` however the joints between `link` and `other` move, in the order of
    /// the description: what holds `link`, with jaws that have joints of their own.
    pub fn holding(&self, link: usize, other: usize) -> Vec<usize> {
        let moving = |edge: &usize| self.edges[*edge].motion.is_some();
        let between: Vec<usize> = self.way(link, other).into_iter().filter(moving).collect();
        let still = |l: &usize| self.way(link, *l).iter().all(|edge| !between.contains(edge));
        (0..self.link_names.len()).filter(still).collect()
    }

    /// The edges on the way between two links.
    fn way(&self, a: usize, b: usize) -> Vec<usize> {
        let (up, down) = (self.edges_above(a), self.edges_above(b));
        let only = |some: &[usize], others: &[usize]| -> Vec<usize> {
            some.iter().copied().filter(|edge| !others.contains(edge)).collect()
        };
        [only(&up, &down), only(&down, &up)].concat()
    }

    fn edges_above(&self, mut link: usize) -> Vec<usize> {
        let mut edges = Vec::new();
        while let Some(edge) = self.above[link] {
            edges.push(edge);
            link = self.edges[edge].parent;
        }
        edges
    }

    /// The highest link that `link` is fixed to.
    fn fixed_root(&self, mut link: usize) -> usize {
        while let Some((parent, false)) = self.carrier(link) {
            link = parent;
        }
        link
    }
}

#[cfg(test)]
mod tests {
    use crate::robot::{RobotModel, description};

    #[test]
    fn the_striper_moves_with_the_flange_and_the_object_with_the_table() {
        let robot = RobotModel::from_urdf(description("kr16_laser").unwrap()).unwrap();
        let names = |link: &str| -> Vec<String> {
            let rigid = robot.rigid_with(robot.link(link).unwrap());
            rigid.iter().map(|&l| robot.link_names()[l].clone()).collect()
        };
        assert_eq!(
            names("sensor_optical"),
            ["link_6", "flange", "bracket", "sensor", "sensor_optical"]
        );
        assert_eq!(names("object"), ["world", "base_link", "table", "object"]);
        let link_1 = robot.link("link_1").unwrap();
        assert_eq!(robot.carrier(link_1), Some((robot.link("base_link").unwrap(), true)));
        assert_eq!(robot.carrier(robot.link("world").unwrap()), None);
    }

    #[test]
    fn jaws_hold_the_object_and_the_arm_behind_them_does_not() {
        let robot = RobotModel::from_urdf(description("omnirob_stereo").unwrap()).unwrap();
        let link = |name: &str| robot.link(name).unwrap();
        let holding = robot.holding(link("object"), link("sensor_optical"));
        let names: Vec<&str> = holding.iter().map(|&l| robot.link_names()[l].as_str()).collect();
        assert_eq!(
            names,
            ["lwr_link_7", "flange", "gripper", "gripper_left", "gripper_right", "object"]
        );
    }
}
