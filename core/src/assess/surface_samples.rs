//! Points distributed evenly over a surface.

use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::{Error, Result};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A point on a mesh with its normal.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceSample {
    /// The point, metres.
    pub point: Vec3,
    /// Unit normal of its triangle.
    pub normal: Vec3,
}

/// Draws `count` samples that are uniform over the area of `mesh`.
///
/// The samples are stratified: one lies in each of `count` equal parts of the area, which are taken
/// in the order of the triangles. Every n-th sample alone therefore still covers the whole surface.
/// `seed` and `stream` select the random numbers.
///
/// # Errors
/// [`Error::Input`] if the mesh has no area.
pub fn sample_surface(
    mesh: &Mesh,
    count: usize,
    seed: u64,
    stream: u64,
) -> Result<Vec<SurfaceSample>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    let total: f64 = (0..mesh.triangles.len()).map(|i| triangle_area(mesh, i)).sum();
    if !(total > 0.0 && total.is_finite()) {
        return Err(Error::input(format!("the mesh has an area of {total} m2: nothing to sample")));
    }
    let mut samples = Vec::with_capacity(count);
    let (mut triangle, mut area_before, mut area) = (0, 0.0, triangle_area(mesh, 0));
    for i in 0..count {
        let target = (i as f64 + rng.random::<f64>()) / count as f64 * total;
        // The index is bounded because rounding may put the target beyond the sum of all areas.
        while target >= area_before + area && triangle + 1 < mesh.triangles.len() {
            area_before += area;
            triangle += 1;
            area = triangle_area(mesh, triangle);
        }
        // Uniform in the triangle (Osada et al. 2002, Shape Distributions, eq. (1)).
        let (root, along) = (rng.random::<f64>().sqrt(), rng.random::<f64>());
        let [a, b, c] = mesh.corners(triangle);
        let point = a * (1.0 - root) + b * (root * (1.0 - along)) + c * (root * along);
        samples.push(SurfaceSample { point, normal: mesh.triangle_normal(triangle) });
    }
    Ok(samples)
}

/// Area of a triangle, square metres.
fn triangle_area(mesh: &Mesh, triangle: usize) -> f64 {
    let [a, b, c] = mesh.corners(triangle);
    (b - a).cross(&(c - a)).norm() / 2.0
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
        let [first, same, other_seed, other_stream] = [(1, 0), (1, 0), (2, 0), (1, 1)]
            .map(|(seed, stream)| sample_surface(&mesh, 10, seed, stream).unwrap()[0].point);
        assert_eq!(first, same);
        assert_ne!(first, other_seed);
        assert_ne!(first, other_stream);
    }

    #[test]
    fn a_mesh_without_area_is_refused() {
        let mesh = Mesh::new(vec![Vec3::zeros(); 3], vec![[0, 1, 2]]);
        assert!(sample_surface(&mesh, 10, 1, 0).unwrap_err().to_string().contains("area"));
    }
}
