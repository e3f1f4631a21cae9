//! The generalised winding number of oriented points: 1 inside, 0 outside, and a smooth transition
//! over holes (Barill et al. 2018, Fast Winding Numbers for Soups and Clouds).

use crate::geometry::{Aabb, Cloud, KdTree, Vec3};
use rayon::prelude::*;

/// The winding number on the surface: half of the points' solid angle lies on either side.
pub(super) const SURFACE_LEVEL: f64 = 0.5;

/// A node counts as far when its distance exceeds this many of its radii; its dipole is then right
/// to about one per cent (Barill et al. 2018, fig. 8).
const MIN_FAR_RADII: f64 = 2.0;
/// A node nearer than this many spacings is never far, because its points' fields are those of
/// discs.
const MIN_FAR_SPACINGS: f64 = 2.0;
/// Points in a leaf at most.
const MAX_LEAF_POINTS: usize = 8;
/// Nodes on the stack of a query: a binary tree of all points that fit the memory is not as deep.
const MAX_STACK: usize = 64;
/// Neighbours from whose distance follows the area that a point stands for.
const AREA_NEIGHBOURS: usize = 8;
/// Largest area of a point in squared spacings, so that lone points do not weigh like a surface.
const MAX_AREA_RATIO: f64 = 3.0;
/// Radius, in spacings, of the disc that a near point's field is softened to.
const DISC_RADIUS_RATIO: f64 = 0.5;

/// Points with their area vectors in a hierarchy of boxes.
///
/// ```text
/// w(q) = sum_i a_i n_i . (p_i - q) / (4 pi |p_i - q|^3)                                        (1)
/// ```
pub(super) struct WindingNumber {
    points: Vec<Vec3>,
    /// Area times normal of each point, square metres.
    dipoles: Vec<Vec3>,
    nodes: Vec<Node>,
    /// Distance between the points, metres. Within it a point's field is that of a small disc, not
    /// of a dipole.
    spacing: f64,
}

struct Node {
    /// Mean of its points, weighted by their areas, metres.
    center: Vec3,
    /// Radius of the sphere about the centre that contains its points, metres.
    radius: f64,
    /// Sum of its points' area vectors, square metres.
    dipole: Vec3,
    points: std::ops::Range<usize>,
    /// The second child; the first follows its parent. 0 for a leaf.
    second: usize,
}

impl WindingNumber {
    /// The winding number of the points of `cloud`, which stand for `areas` (square metres) and lie
    /// `spacing` (metres) apart.
    pub(super) fn new(cloud: &Cloud, areas: &[f64], spacing: f64) -> WindingNumber {
        let mut order: Vec<usize> = (0..cloud.len()).collect();
        let mut nodes = Vec::new();
        build_tree(&cloud.points, &mut order, 0, &mut nodes);
        let points: Vec<Vec3> = order.iter().map(|&i| cloud.points[i]).collect();
        let dipoles: Vec<Vec3> = order.iter().map(|&i| cloud.normals[i] * areas[i]).collect();
        let mut winding = WindingNumber { points, dipoles, nodes, spacing };
        winding.summarise(&order.iter().map(|&i| areas[i]).collect::<Vec<f64>>());
        winding
    }

    /// Computes centres, radii and dipoles of the nodes.
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

    /// The winding number at `query` (metres).
    pub(super) fn at(&self, query: &Vec3) -> f64 {
        let mut sum = 0.0;
        let mut stack = [0_usize; MAX_STACK];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let index = stack[depth];
            let node = &self.nodes[index];
            let offset = node.center - query;
            let square = offset.norm_squared();
            if square > (MIN_FAR_RADII * node.radius).powi(2)
                && square > MIN_FAR_SPACINGS * MIN_FAR_SPACINGS * self.spacing * self.spacing
            {
                sum += node.dipole.dot(&offset) / (square * square.sqrt()); // (1)
            } else if node.second == 0 {
                sum += node.points.clone().map(|i| self.near_field(i, query)).sum::<f64>();
            } else {
                stack[depth] = node.second;
                stack[depth + 1] = index + 1;
                depth += 2;
            }
        }
        sum / (4.0 * std::f64::consts::PI) // (1)
    }

    /// The term of a point in equation (1) but for its factor 4 pi, softened to the field of a
    /// disc.
    fn near_field(&self, point: usize, query: &Vec3) -> f64 {
        let offset = self.points[point] - query;
        let softening = DISC_RADIUS_RATIO * DISC_RADIUS_RATIO * self.spacing * self.spacing;
        let distance = (offset.norm_squared() + softening).sqrt();
        self.dipoles[point].dot(&offset) / distance.powi(3) // (1)
    }
}

/// The area that each point stands for, square metres: that of the disc that reaches to its
/// neighbours, divided among them; at most three times the squared `spacing` (metres).
pub(super) fn point_areas(cloud: &Cloud, spacing: f64) -> Vec<f64> {
    let tree = KdTree::new(&cloud.points);
    (0..cloud.len()).into_par_iter().map(|i| point_area(cloud, &tree, i, spacing)).collect()
}

/// The area that the point `i` stands for, square metres.
fn point_area(cloud: &Cloud, tree: &KdTree, i: usize, spacing: f64) -> f64 {
    let near = tree.nearest_n(&cloud.points[i], 2 * AREA_NEIGHBOURS);
    // Only neighbours of the same side share the surface.
    let mut same_side = near.iter().filter(|(j, _)| cloud.normals[*j].dot(&cloud.normals[i]) > 0.0);
    match same_side.nth(AREA_NEIGHBOURS) {
        // The disc contains the point, the neighbours before the last and half of the last one.
        Some((_, square)) => (std::f64::consts::PI * square / (AREA_NEIGHBOURS as f64 + 0.5))
            .min(MAX_AREA_RATIO * spacing * spacing),
        None => spacing * spacing,
    }
}

/// Appends the nodes of the binary tree over the points in `order`, of which the first has place
/// `first` in the order of all, each parent before its children.
fn build_tree(points: &[Vec3], order: &mut [usize], first: usize, nodes: &mut Vec<Node>) {
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
    if order.len() <= MAX_LEAF_POINTS {
        return;
    }
    let extent = Aabb::from_points(order.iter().map(|&i| &points[i])).extent();
    let axis = extent.imax();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&a, &b| {
        points[a][axis].total_cmp(&points[b][axis]).then(a.cmp(&b))
    });
    let (low, high) = order.split_at_mut(middle);
    build_tree(points, low, first, nodes);
    nodes[index].second = nodes.len();
    build_tree(points, high, first + middle, nodes);
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
        let winding = WindingNumber::new(&cloud, &point_areas(&cloud, spacing), spacing);
        for (z, expected) in [(0.0, 1.0), (0.5, 1.0), (0.85, 1.0), (1.15, 0.0), (2.0, 0.0)] {
            let value = winding.at(&Vec3::new(0.01, 0.02, z));
            assert!((value - expected).abs() < 0.05, "{z}: {value}");
        }
        assert!((winding.at(&Vec3::new(0.0, 0.0, 1.0)) - 0.5).abs() < 0.15);
    }

    #[test]
    fn the_tree_agrees_with_the_plain_sum() {
        let (cloud, spacing) = sphere(3000, 0.2);
        let winding = WindingNumber::new(&cloud, &point_areas(&cloud, spacing), spacing);
        for query in [Vec3::new(0.3, 0.1, 0.2), Vec3::new(0.1, 0.0, -0.9), Vec3::new(1.2, 0.4, 0.0)]
        {
            let plain =
                (0..winding.points.len()).map(|i| winding.near_field(i, &query)).sum::<f64>();
            let plain = plain / (4.0 * std::f64::consts::PI);
            assert!((winding.at(&query) - plain).abs() < 0.02);
        }
    }

    #[test]
    fn the_areas_of_all_points_add_up_to_that_of_the_sphere() {
        let (cloud, spacing) = sphere(3000, 0.0);
        let total: f64 = point_areas(&cloud, spacing).iter().sum();
        assert!((total / (4.0 * std::f64::consts::PI) - 1.0).abs() < 0.05, "{total}");
        // A point without neighbours on its side stands for a squared spacing.
        let lone = cloud.select(&[0]);
        assert_eq!(point_areas(&lone, 0.1), [0.1 * 0.1]);
    }
}
