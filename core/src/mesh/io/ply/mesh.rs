//! Meshes in PLY files.

use super::{Column, Element, Layout, Ply, parse, push_floats};
use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::mesh::io::colour::{confidence_colour, confidence_scale};
use crate::mesh::io::polygons::Polygons;
use crate::{Error, Result};
use std::path::Path;

const INDICES: [&str; 2] = ["vertex_indices", "vertex_index"];
const NORMALS: [[&str; 3]; 2] = [["nx", "ny", "nz"], ["normal_x", "normal_y", "normal_z"]];

/// Reads a mesh; polygons are cut into fans.
pub(in crate::mesh::io) fn parse_mesh(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let wanted = |element: &str, property: &str| match element {
        "vertex" => NORMALS
            .iter()
            .flatten()
            .chain(&["x", "y", "z", "sigma", "observed"])
            .any(|n| *n == property),
        "face" => INDICES.contains(&property),
        _ => false,
    };
    let ply = parse(bytes, path, &wanted)?;
    let vertex = ply.require(path, "vertex", "a mesh needs vertices")?;
    let rows = |columns: [&Column; 3]| -> Vec<Vec3> {
        let point = |i| Vec3::new(columns[0].get(i), columns[1].get(i), columns[2].get(i));
        (0..vertex.count).map(point).collect()
    };
    let mut mesh = Mesh::new(rows(positions(vertex, path)?), triangles(&ply, vertex.count, path)?);
    mesh.normals = normals(vertex).map(rows).unwrap_or_default();
    if let Some(sigma) = vertex.scalar(&["sigma"]) {
        mesh.sigma = (0..vertex.count).map(|i| sigma.get(i)).collect();
    }
    if let Some(observed) = vertex.scalar(&["observed"]) {
        mesh.observed = (0..vertex.count).map(|i| observed.get(i) != 0.0).collect();
    }
    Ok(mesh)
}

/// The columns x, y and z.
pub(super) fn positions<'a>(vertex: &'a Element, path: &Path) -> Result<[&'a Column; 3]> {
    vertex.triple(["x", "y", "z"]).ok_or_else(|| {
        let has: Vec<_> = vertex.properties.iter().map(|p| p.name.as_str()).collect();
        let has = has.join(", ");
        Error::format(path, format!("its vertices need the properties x, y and z, but have: {has}"))
    })
}

/// The columns of the normal, by either of the names in use.
pub(super) fn normals(vertex: &Element) -> Option<[&Column; 3]> {
    NORMALS.into_iter().find_map(|names| vertex.triple(names))
}

/// Whether `property` is a component of a normal.
pub(super) fn is_normal(property: &str) -> bool {
    NORMALS.as_flattened().contains(&property)
}

fn triangles(ply: &Ply, vertices: usize, path: &Path) -> Result<Vec<[u32; 3]>> {
    let purpose = "it is a point cloud or of another kind, not a mesh of faces";
    let face = ply.require(path, "face", purpose)?;
    let (starts, values) = face.list(&INDICES).ok_or_else(|| {
        Error::format(path, "its faces have no list 'vertex_indices': it tells no triangles")
    })?;
    let mut polygons = Polygons::new(vertices);
    for (index, range) in starts.windows(2).enumerate() {
        let corners = &values[range[0]..range[1]];
        polygons.push(corners).map_err(|e| Error::format(path, format!("face {index} {e}")))?;
    }
    polygons.finish(path)
}

/// The file's bytes: the columns of the page "Output mesh", without those that the mesh does not have (the
/// colours come from sigma).
pub(in crate::mesh::io) fn write_mesh(mesh: &Mesh, comments: &[String]) -> Vec<u8> {
    let (sigma, observed) = (!mesh.sigma.is_empty(), !mesh.observed.is_empty());
    let mut properties = vec!["float x", "float y", "float z", "float nx", "float ny", "float nz"];
    if sigma {
        properties.extend(["uchar red", "uchar green", "uchar blue", "float sigma"]);
    }
    if observed {
        properties.push("uchar observed");
    }
    let mut layout = Layout::new(comments);
    layout.element("vertex", mesh.vertices.len(), &properties);
    layout.element("face", mesh.triangles.len(), &["list uchar int vertex_indices"]);
    let mut bytes = layout.into_bytes();
    bytes.reserve(mesh.vertices.len() * 32 + mesh.triangles.len() * 13);
    let scale = confidence_scale(&mesh.sigma);
    for (i, vertex) in mesh.vertices.iter().enumerate() {
        push_floats(&mut bytes, vertex.iter().chain(mesh.normals[i].iter()).map(|v| *v as f32));
        if sigma {
            bytes.extend_from_slice(&confidence_colour(mesh.sigma[i], scale));
            push_floats(&mut bytes, [mesh.sigma[i] as f32]);
        }
        if observed {
            bytes.push(mesh.observed[i].into());
        }
    }
    for triangle in &mesh.triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|v| v.to_le_bytes()));
    }
    bytes
}
