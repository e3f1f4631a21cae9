//! The generalised winding number of oriented points: 1 inside, 0 outside, and a smooth way in between over
//! holes (Barill et al. 2018, Fast Winding Numbers for Soups and Clouds).

use crate::geometry::{Aabb, Cloud, KdTree, Vec3};
use rayon::prelude::*;

/// A node counts as far when its distance exceeds this many of its radii; its dipole is then right to about
/// one per cent (Barill et al. 2018, fig. 8).
const FAR: f64 = 2.0;
/// Points in a leaf.
const LEAF: usize = 8;
/// Neighbours that tell the area which a point stands for.
const NEIGHBOURS: usize = 8;

/// Points with their area vectors in a hierarchy of boxes.
pub(super) struct Winding {
    points: Vec<Vec3>,
    /// Area times normal of each point, square metres.
    dipoles: Vec<Vec3>,
    nodes: Vec<Node>,
    /// Below this distance (metres) a point's field is that of a small disc, not of a dipole.
    blur: f64,
}

struct Node {
    center: Vec3,
    radius: f64,
    dipole: Vec3,
    points: std::ops::Range<usize>,
    /// The second child; the first follows its parent. 0 for a leaf.
    second: usize,
}

impl Winding {
    /// The winding number of `cloud`'s points, which stand for `areas` (square metres) and lie `spacing` (metres) apart.
    pub(super) fn new(cloud: &Cloud, areas: &[f64], spacing: f64) -> Winding {
        let mut order: Vec<usize> = (0..cloud.len()).collect();
        let mut nodes = Vec::new();
        build(&cloud.points, &mut order, 0, &mut nodes);
        let points: Vec<Vec3> = order.iter().map(|&i| cloud.points[i]).collect();
        let dipoles: Vec<Vec3> = order.iter().map(|&i| cloud.normals[i] * areas[i]).collect();
        let mut winding = Winding { points, dipoles, nodes, blur: spacing };
        winding.summarise(&order.iter().map(|&i| areas[i]).collect::<Vec<f64>>());
        winding
    }

    fn summarise(&mut self, areas: &[f64]) {
        for node in &mut self.nodes {
            let members = node.points.clone();
            let total: f64 = areas[members.clone()].iter().sum();
            node.center = members.clone().map(|i| self.points[i] * areas[i]).sum::<Vec3>() / total;
            node.dipole = self.dipoles[members.clone()].iter().sum();
            node.radius =
                self.points[members].iter().map(|p| (p - node.center).norm()).fold(0.0, f64::max);
        }
    }

    /// The winding number at `query`.
    pub(super) fn at(&self, query: &Vec3) -> f64 {
        let mut sum = 0.0;
        let mut stack = [0_usize; 64];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let index = stack[depth];
            let node = &self.nodes[index];
            let offset = node.center - query;
            let square = offset.norm_squared();
            if square > (FAR * node.radius).powi(2) && square > 4.0 * self.blur * self.blur {
                sum += node.dipole.dot(&offset) / (square * square.sqrt());
            } else if node.second == 0 {
                sum += node.points.clone().map(|i| self.near(i, query)).sum::<f64>();
            } else {
                stack[depth] = node.second;
                stack[depth + 1] = index + 1;
                depth += 2;
            }
        }
        sum / (4.0 * std::f64::consts::PI)
    }

    fn near(&self, point: usize, query: &Vec3) -> f64 {
        let offset = self.points[point] - query;
        let distance = (offset.norm_squared() + 0.25 * self.blur * self.blur).sqrt();
        self.dipoles[point].dot(&offset) / distance.powi(3)
    }
}

/// The area that each point stands for: that of the disc to its neighbours, divided among them; at most what
/// the spacing allows three times over, so that lone points do not weigh like a surface.
pub(super) fn areas(cloud: &Cloud, spacing: f64) -> Vec<f64> {
    let tree = KdTree::new(&cloud.points);
    let largest = 3.0 * spacing * spacing;
    let area = |i: usize| {
        // Only neighbours of the same side share the surface.
        let near = tree.nearest_n(&cloud.points[i], 2 * NEIGHBOURS);
        let mut same = near.iter().filter(|(j, _)| cloud.normals[*j].dot(&cloud.normals[i]) > 0.0);
        match same.nth(NEIGHBOURS) {
            Some((_, square)) => {
                (std::f64::consts::PI * square / (NEIGHBOURS as f64 + 0.5)).min(largest)
            }
            None => spacing * spacing,
        }
    };
    (0..cloud.len()).into_par_iter().map(area).collect()
}

fn build(points: &[Vec3], order: &mut [usize], first: usize, nodes: &mut Vec<Node>) {
    if order.is_empty() {
        return;
    }
    let index = nodes.len();
    nodes.push(Node {
        center: Vec3::zeros(),
        radius: 0.0,
        dipole: Vec3::zeros(),
        points: first..first + order.len(),
        second: 0,
    });
    if order.len() <= LEAF {
        return;
    }
    let extent = Aabb::of(order.iter().map(|&i| &points[i])).extent();
    let axis = extent.imax();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&a, &b| {
        points[a][axis].total_cmp(&points[b][axis]).then(a.cmp(&b))
    });
    let (low, high) = order.split_at_mut(middle);
    build(points, low, first, nodes);
    nodes[index].second = nodes.len();
    build(points, high, first + middle, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sphere(count: usize, hole: f64) -> (Cloud, f64) {
        let mut cloud = Cloud::default();
        for i in 0..count {
            // Fibonacci lattice.
            let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
            let phi = i as f64 * 2.399_963_229_728_653;
            let r = (1.0 - z * z).sqrt();
            if z > -1.0 + hole {
                let n = Vec3::new(r * phi.cos(), r * phi.sin(), z);
                cloud.push(n, n, 0.01, 1);
            }
        }
        (cloud, (4.0 * std::f64::consts::PI / count as f64).sqrt())
    }

    #[test]
    fn one_inside_and_zero_outside_a_sphere() {
        let (cloud, spacing) = sphere(5000, 0.0);
        let winding = Winding::new(&cloud, &areas(&cloud, spacing), spacing);
        for (z, expected) in [(0.0, 1.0), (0.5, 1.0), (0.85, 1.0), (1.15, 0.0), (2.0, 0.0)] {
            let value = winding.at(&Vec3::new(0.01, 0.02, z));
            assert!((value - expected).abs() < 0.05, "{z}: {value}");
        }
        assert!((winding.at(&Vec3::new(0.0, 0.0, 1.0)) - 0.5).abs() < 0.15);
    }

    #[test]
    fn the_tree_agrees_with_the_plain_sum() {
        let (cloud, spacing) = sphere(3000, 0.2);
        let winding = Winding::new(&cloud, &areas(&cloud, spacing), spacing);
        for query in [Vec3::new(0.3, 0.1, 0.2), Vec3::new(0.1, 0.0, -0.9), Vec3::new(1.2, 0.4, 0.0)]
        {
            let plain = (0..winding.points.len()).map(|i| winding.near(i, &query)).sum::<f64>();
            let plain = plain / (4.0 * std::f64::consts::PI);
            assert!((winding.at(&query) - plain).abs() < 0.02);
        }
    }
}
