//! Points spread evenly over a surface.

use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::{Error, Result};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A point on a mesh.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// The point, metres.
    pub point: Vec3,
    /// Unit normal of its triangle.
    pub normal: Vec3,
}

/// `count` samples, uniform over the area, stratified: one in each of `count` equal parts of the area, in the order
/// of the triangles, so that every n-th of them is again spread over the whole surface.
///
/// # Errors
/// [`Error::Input`] if the mesh has no area.
pub fn sample_surface(mesh: &Mesh, count: usize, seed: u64, stream: u64) -> Result<Vec<Sample>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    let area = |i: usize| {
        let [a, b, c] = mesh.corners(i);
        (b - a).cross(&(c - a)).norm() / 2.0
    };
    let total: f64 = (0..mesh.triangles.len()).map(area).sum();
    if !(total > 0.0 && total.is_finite()) {
        return Err(Error::input(format!("the mesh has an area of {total} m2: nothing to sample")));
    }
    let mut samples = Vec::with_capacity(count);
    let (mut triangle, mut before, mut own) = (0, 0.0, area(0));
    for i in 0..count {
        let target = (i as f64 + rng.random::<f64>()) / count as f64 * total;
        // Never runs past the last triangle with an area, even if rounding puts the target beyond the sum.
        while target >= before + own && triangle + 1 < mesh.triangles.len() {
            before += own;
            triangle += 1;
            own = area(triangle);
        }
        // Osada et al. 2002, Shape Distributions, eq. (1).
        let (root, along) = (rng.random::<f64>().sqrt(), rng.random::<f64>());
        let [a, b, c] = mesh.corners(triangle);
        let point = a * (1.0 - root) + b * (root * (1.0 - along)) + c * (root * along);
        samples.push(Sample { point, normal: mesh.triangle_normal(triangle) });
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_shapes::{cuboid, sphere};

    #[test]
    fn each_face_gets_its_share_of_the_area() {
        let mesh = cuboid(Vec3::zeros(), Vec3::new(1.0, 2.0, 3.0));
        let samples = sample_surface(&mesh, 22_000, 3, 0).unwrap();
        for (axis, area) in [(0, 6.0), (1, 3.0), (2, 2.0)] {
            let on_face = samples.iter().filter(|s| s.normal[axis] < -0.5).count() as f64;
            assert!((on_face - 1000.0 * area).abs() <= 2.0, "{axis}: {on_face}");
            let mean = samples.iter().map(|s| s.point[axis]).sum::<f64>() / 22_000.0;
            assert!((mean - mesh.vertices[7][axis] / 2.0).abs() < 0.01);
        }
        let rounding = mesh.aabb().padded(1e-12);
        assert!(samples.iter().all(|s| rounding.contains(&s.point)));
    }

    #[test]
    fn the_seed_and_the_stream_decide() {
        let mesh = sphere(1.0, 1);
        let first = |seed, stream| sample_surface(&mesh, 10, seed, stream).unwrap()[0].point;
        assert_eq!(first(1, 0), first(1, 0));
        assert_ne!(first(1, 0), first(2, 0));
        assert_ne!(first(1, 0), first(1, 1));
    }

    #[test]
    fn a_mesh_without_area_is_refused() {
        let mesh = Mesh::new(vec![Vec3::zeros(); 3], vec![[0, 1, 2]]);
        assert!(sample_surface(&mesh, 10, 1, 0).unwrap_err().to_string().contains("area"));
    }
}
