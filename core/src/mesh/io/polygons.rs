//! What several mesh readers share: splitting of polygons into triangles, merging of vertices,
//! checks.

use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::{Error, Result};
use std::collections::HashMap;
use std::path::Path;

/// Collects polygons as fans of triangles. Polygons with fewer than three corners have no area and
/// are left out.
pub(super) struct PolygonFans {
    vertices: usize,
    triangles: Vec<[u32; 3]>,
    fan: Vec<u32>,
}

impl PolygonFans {
    /// Starts a mesh with this number of vertices.
    pub(super) fn new(vertices: usize) -> PolygonFans {
        PolygonFans { vertices, triangles: Vec::new(), fan: Vec::new() }
    }

    /// Adds a polygon. The error message is the rest of a sentence that starts with the polygon's
    /// name.
    pub(super) fn push(&mut self, corners: &[f64]) -> std::result::Result<(), String> {
        self.fan.clear();
        for &corner in corners {
            // The negation also catches NaN.
            if !(corner >= 0.0 && corner < self.vertices.min(u32::MAX as usize) as f64) {
                return Err(format!(
                    "names vertex {corner}, but there are {} (counted from 0)",
                    self.vertices
                ));
            }
            self.fan.push(corner as u32);
        }
        if let [first, rest @ ..] = self.fan.as_slice() {
            self.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        }
        Ok(())
    }

    /// The triangles.
    ///
    /// # Errors
    /// [`Error::Format`] if there is none.
    pub(super) fn finish(self, path: &Path) -> Result<Vec<[u32; 3]>> {
        if self.triangles.is_empty() {
            return Err(Error::format(path, "has no face: it is a point cloud, not a mesh"));
        }
        Ok(self.triangles)
    }

    /// The triangles, of which there may be none.
    pub(super) fn into_triangles(self) -> Vec<[u32; 3]> {
        self.triangles
    }
}

/// Returns an error if a coordinate is not finite.
pub(super) fn check_finite(mesh: &Mesh, path: &Path) -> Result<()> {
    match mesh.vertices.iter().position(|v| !v.iter().all(|c| c.is_finite())) {
        Some(index) => Err(Error::format(
            path,
            format!("the coordinates of vertex {index} are not finite: remove it and its faces"),
        )),
        None => Ok(()),
    }
}

/// Merges vertices of equal position (compared bit by bit in single precision) and removes the
/// triangles that have a vertex twice then. Attributes are dropped.
pub(super) fn weld_vertices(mesh: &Mesh) -> Mesh {
    let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.vertices.len());
    let mut vertices: Vec<Vec3> = Vec::new();
    let mut joined = Vec::with_capacity(mesh.vertices.len());
    for vertex in &mesh.vertices {
        // Adding zero turns -0 into 0.
        let key = [vertex.x, vertex.y, vertex.z].map(|v| (v as f32 + 0.0).to_bits());
        let next = vertices.len() as u32;
        let index = *known.entry(key).or_insert(next);
        if index == next {
            vertices.push(*vertex);
        }
        joined.push(index);
    }
    let triangles = mesh.triangles.iter().map(|t| t.map(|v| joined[v as usize]));
    let kept = triangles.filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
    Mesh::new(vertices, kept.collect())
}

/// Reads a vector of three little-endian floats.
pub(super) fn read_vector(bytes: &[u8]) -> Vec3 {
    Vec3::from_fn(|i, _| {
        let b = &bytes[4 * i..4 * i + 4];
        f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_become_fans_and_bad_corners_are_named() {
        let mut polygons = PolygonFans::new(5);
        polygons.push(&[0.0, 1.0, 2.0, 3.0, 4.0]).unwrap();
        polygons.push(&[4.0, 3.0]).unwrap();
        polygons.push(&[]).unwrap();
        for bad in [5.0, -1.0, f64::NAN] {
            let message = polygons.push(&[0.0, 1.0, bad]).unwrap_err();
            assert_eq!(message, format!("names vertex {bad}, but there are 5 (counted from 0)"));
        }
        assert_eq!(polygons.into_triangles(), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        assert!(PolygonFans::new(3).finish(Path::new("x")).is_err());
    }

    #[test]
    fn equal_positions_merge_and_folded_triangles_go() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, -0.0]];
        let mesh =
            Mesh::new(positions.map(Vec3::from).to_vec(), vec![[0, 1, 2], [0, 3, 2], [1, 3, 2]]);
        let welded = weld_vertices(&mesh);
        assert_eq!(welded.vertices, mesh.vertices[..3]);
        assert_eq!(welded.triangles, [[0, 1, 2], [0, 1, 2]]);
    }
}
