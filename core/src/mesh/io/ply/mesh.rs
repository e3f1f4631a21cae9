//! Meshes in PLY files.

use super::{Ply, PlyElement, PlyHeader, PropertyColumn, parse, push_floats};
use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::mesh::io::confidence_colour::{confidence_colour, confidence_scale};
use crate::mesh::io::polygons::PolygonFans;
use crate::{Error, Result};
use std::path::Path;

/// Bytes of a vertex with all attributes.
const MAX_VERTEX_BYTES: usize = 32;
/// Bytes of a triangle: its count of corners and three indices.
const FACE_BYTES: usize = 13;
/// Names in use for the vertex indices of a face.
const INDEX_PROPERTIES: [&str; 2] = ["vertex_indices", "vertex_index"];
/// Names in use for the components of a normal.
const NORMAL_PROPERTIES: [[&str; 3]; 2] =
    [["nx", "ny", "nz"], ["normal_x", "normal_y", "normal_z"]];

/// Reads a mesh; polygons are split into fans of triangles.
pub(in crate::mesh::io) fn parse_mesh(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let ply = parse(bytes, path, &is_mesh_property)?;
    let vertex = ply.require_element(path, "vertex", "a mesh needs vertices")?;
    let vertices = read_vectors(vertex.count, position_columns(vertex, path)?);
    let mut mesh = Mesh::new(vertices, parse_triangles(&ply, vertex.count, path)?);
    mesh.normals =
        normal_columns(vertex).map(|c| read_vectors(vertex.count, c)).unwrap_or_default();
    if let Some(sigma) = vertex.scalar_column(&["sigma"]) {
        mesh.sigma = (0..vertex.count).map(|i| sigma.scalar_at(i)).collect();
    }
    if let Some(observed) = vertex.scalar_column(&["observed"]) {
        mesh.observed = (0..vertex.count).map(|i| observed.scalar_at(i) != 0.0).collect();
    }
    Ok(mesh)
}

/// Whether a mesh is made of this property.
fn is_mesh_property(element: &str, property: &str) -> bool {
    match element {
        "vertex" => is_normal(property) || ["x", "y", "z", "sigma", "observed"].contains(&property),
        "face" => INDEX_PROPERTIES.contains(&property),
        _ => false,
    }
}

/// The first `count` rows of three columns as vectors.
fn read_vectors(count: usize, [x, y, z]: [&PropertyColumn; 3]) -> Vec<Vec3> {
    (0..count).map(|i| Vec3::new(x.scalar_at(i), y.scalar_at(i), z.scalar_at(i))).collect()
}

/// The columns x, y and z.
pub(super) fn position_columns<'a>(
    vertex: &'a PlyElement,
    path: &Path,
) -> Result<[&'a PropertyColumn; 3]> {
    vertex.vector_columns(["x", "y", "z"]).ok_or_else(|| {
        let has: Vec<_> = vertex.properties.iter().map(|p| p.name.as_str()).collect();
        let has = has.join(", ");
        Error::format(path, format!("its vertices need the properties x, y and z, but have: {has}"))
    })
}

/// The columns of the normal, if the vertices have one.
pub(super) fn normal_columns(vertex: &PlyElement) -> Option<[&PropertyColumn; 3]> {
    NORMAL_PROPERTIES.into_iter().find_map(|names| vertex.vector_columns(names))
}

/// Whether `property` is a component of a normal.
pub(super) fn is_normal(property: &str) -> bool {
    NORMAL_PROPERTIES.as_flattened().contains(&property)
}

/// The triangles of the faces.
fn parse_triangles(ply: &Ply, vertices: usize, path: &Path) -> Result<Vec<[u32; 3]>> {
    let purpose = "it is a point cloud or of another kind, not a mesh of faces";
    let face = ply.require_element(path, "face", purpose)?;
    let (starts, values) = face.list_column(&INDEX_PROPERTIES).ok_or_else(|| {
        Error::format(path, "its faces have no list 'vertex_indices': it tells no triangles")
    })?;
    let mut polygons = PolygonFans::new(vertices);
    for (index, range) in starts.windows(2).enumerate() {
        let corners = &values[range[0]..range[1]];
        polygons.push(corners).map_err(|e| Error::format(path, format!("face {index} {e}")))?;
    }
    polygons.finish(path)
}

/// The bytes of a file. Vertices have x y z and nx ny nz and, if the mesh has them, red green blue
/// (the colours of sigma), sigma and observed.
pub(in crate::mesh::io) fn write_mesh(mesh: &Mesh, comments: &[String]) -> Vec<u8> {
    let (has_sigma, has_observed) = (!mesh.sigma.is_empty(), !mesh.observed.is_empty());
    let mut properties = vec!["float x", "float y", "float z", "float nx", "float ny", "float nz"];
    if has_sigma {
        properties.extend(["uchar red", "uchar green", "uchar blue", "float sigma"]);
    }
    if has_observed {
        properties.push("uchar observed");
    }
    let mut header = PlyHeader::new(comments);
    header.add_element("vertex", mesh.vertices.len(), &properties);
    header.add_element("face", mesh.triangles.len(), &["list uchar int vertex_indices"]);
    let mut bytes = header.into_bytes();
    bytes.reserve(mesh.vertices.len() * MAX_VERTEX_BYTES + mesh.triangles.len() * FACE_BYTES);
    let scale = confidence_scale(&mesh.sigma);
    for (i, vertex) in mesh.vertices.iter().enumerate() {
        push_floats(&mut bytes, vertex.iter().chain(mesh.normals[i].iter()).map(|v| *v as f32));
        if has_sigma {
            bytes.extend_from_slice(&confidence_colour(mesh.sigma[i], scale));
            push_floats(&mut bytes, [mesh.sigma[i] as f32]);
        }
        if has_observed {
            bytes.push(mesh.observed[i].into());
        }
    }
    for triangle in &mesh.triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|v| v.to_le_bytes()));
    }
    bytes
}
