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
}
