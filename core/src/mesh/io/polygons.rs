//! Polygons to triangles, and the checks that every mesh reader shares.

use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::{Error, Result};
use std::collections::HashMap;
use std::path::Path;

/// Collects polygons as fans of triangles. Polygons of fewer than three corners have no area and are left out.
pub(super) struct Polygons {
    vertices: usize,
    triangles: Vec<[u32; 3]>,
    fan: Vec<u32>,
}

impl Polygons {
    /// For a mesh of that many vertices.
    pub(super) fn new(vertices: usize) -> Polygons {
        Polygons { vertices, triangles: Vec::new(), fan: Vec::new() }
    }

    /// Adds a polygon; the error is the rest of a sentence that starts with the polygon's name.
    pub(super) fn push(&mut self, corners: &[f64]) -> std::result::Result<(), String> {
        self.fan.clear();
        for &corner in corners {
            // Written so that NaN fails too.
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

/// Checks what a reader cannot: that all coordinates are finite.
pub(super) fn check_finite(mesh: &Mesh, path: &Path) -> Result<()> {
    match mesh.vertices.iter().position(|v| !v.iter().all(|c| c.is_finite())) {
        Some(index) => Err(Error::format(
            path,
            format!("the coordinates of vertex {index} are not finite: remove it and its faces"),
        )),
        None => Ok(()),
    }
}

/// Joins vertices of equal position (compared in single precision, bit by bit); faces that fold up go.
/// Attributes are dropped.
pub(super) fn weld(mesh: &Mesh) -> Mesh {
    let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.vertices.len());
    let mut vertices: Vec<Vec3> = Vec::new();
    let mut joined = Vec::with_capacity(mesh.vertices.len());
    for vertex in &mesh.vertices {
        // Adding zero makes -0 equal to 0.
        let key = [vertex.x, vertex.y, vertex.z].map(|v| (v as f32 + 0.0).to_bits());
        let next = vertices.len() as u32;
        let index = *known.entry(key).or_insert(next);
        if index == next {
            vertices.push(*vertex);
        }
        joined.push(index);
    }
    let triangles = mesh.triangles.iter().map(|t| t.map(|v| joined[v as usize]));
    let whole = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    Mesh::new(vertices, triangles.filter(whole).collect())
}
