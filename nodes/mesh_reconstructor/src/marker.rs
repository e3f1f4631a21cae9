//! The mesh as a marker for RViz and other viewers.

use puffer_core::mesh::io::{confidence_colour, confidence_scale};
use puffer_core::mesh::{Mesh, simplify_by_clustering};
use puffer_msgs::geometry_msgs::msg::{Point, Vector3};
use puffer_msgs::std_msgs::msg::{ColorRGBA, Header};
use puffer_msgs::visualization_msgs::msg::Marker;
use puffer_ros::conversions::point_message;

/// Colour of a mesh without sigma.
const UNKNOWN_SIGMA_COLOUR: [u8; 3] = [215, 215, 220];

/// Bytes of a triangle in the message: three corners of three numbers and a colour each.
const TRIANGLE_BYTES: usize = 3 * (24 + 16);
/// Bytes of the message without its triangles, at most.
const OVERHEAD_BYTES: usize = 1000;

/// The mesh as triangles with a colour at each corner: green to red by sigma, as in its files, and
/// red where nothing was measured; with fewer triangles if it would take more than `most_bytes`.
pub(crate) fn mesh_marker(mesh: &Mesh, header: Header, most_bytes: usize) -> Marker {
    // The colours' scale is that of the whole mesh.
    let scale = confidence_scale(&mesh.sigma);
    let mesh =
        &simplify_by_clustering(mesh, most_bytes.saturating_sub(OVERHEAD_BYTES) / TRIANGLE_BYTES);
    let corners: Vec<usize> = mesh.triangles.as_flattened().iter().map(|v| *v as usize).collect();
    let points: Vec<Point> = corners.iter().map(|v| point_message(&mesh.vertices[*v])).collect();
    let mut marker = Marker {
        header,
        ns: "model".to_owned(),
        r#type: Marker::TRIANGLE_LIST,
        scale: Vector3 { x: 1.0, y: 1.0, z: 1.0 },
        color: ColorRGBA { r: 1.0, g: 1.0, b: 1.0, a: 1.0 },
        points,
        colors: corners.into_iter().map(|v| vertex_colour(mesh, v, scale)).collect(),
        ..Marker::default()
    };
    marker.pose.orientation.w = 1.0;
    marker
}

/// The colour of a vertex on the scale of the whole mesh.
fn vertex_colour(mesh: &Mesh, vertex: usize, scale: f64) -> ColorRGBA {
    let unobserved = mesh.observed.get(vertex) == Some(&false);
    let colour = match mesh.sigma.get(vertex) {
        _ if unobserved => confidence_colour(f64::NAN, scale),
        Some(sigma) => confidence_colour(*sigma, scale),
        None => UNKNOWN_SIGMA_COLOUR,
    };
    let [r, g, b] = colour.map(|byte| f32::from(byte) / 255.0);
    ColorRGBA { r, g, b, a: 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::geometry::Vec3;

    #[test]
    fn each_corner_has_the_colour_of_its_vertex() {
        let mesh = Mesh {
            vertices: vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            normals: Vec::new(),
            sigma: vec![0.0, 1e-4, 1e-4, 1e-4],
            observed: vec![true, true, true, false],
        };
        let marker = mesh_marker(&mesh, Header::default(), 100_000);
        assert_eq!((marker.points.len(), marker.colors.len()), (6, 6));
        assert_eq!((marker.points[5].z, marker.scale.x), (1.0, 1.0));
        let [first, last] = [&marker.colors[0], &marker.colors[5]];
        assert!(first.g > 0.8 && first.r < 0.2, "certain: green, {first:?}");
        assert!(last.r > 0.8 && last.g < 0.2, "not observed: red, {last:?}");
        assert!(marker.colors.iter().all(|c| c.a == 1.0));
    }

    #[test]
    fn a_marker_fits_the_bytes_that_there_are() {
        // A sheet of 5,000 triangles.
        let corners = (0..51 * 51).map(|k| Vec3::new(f64::from(k % 51), f64::from(k / 51), 0.0));
        let squares = (0..50).flat_map(|y| (0..50).map(move |x| y * 51 + x));
        let triangles = squares.flat_map(|a| {
            let [b, c, d] = [a + 1, a + 52, a + 51];
            [[a, b, c], [a, c, d]]
        });
        let mesh = Mesh::new(corners.map(|p| p * 1e-3).collect(), triangles.collect());
        for most_bytes in [1_000_000, 212_992] {
            let marker = mesh_marker(&mesh, Header::default(), most_bytes);
            let bytes = puffer_msgs::cdr::to_bytes(&marker).unwrap().len();
            assert!((most_bytes / 3..=most_bytes).contains(&bytes), "{bytes} of {most_bytes}");
            assert_eq!(marker.colors.len(), marker.points.len());
        }
    }
}
