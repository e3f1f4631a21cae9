//! Writing of GLB files.

use super::{
    ARRAY_BUFFER_TARGET, BINARY_CHUNK, ELEMENT_ARRAY_BUFFER_TARGET, FLOAT_COMPONENT,
    GENERATOR_NAME, GLB_MAGIC, JSON_CHUNK,
};
use super::{UNSIGNED_BYTE_COMPONENT, UNSIGNED_INT_COMPONENT};
use crate::geometry::{Aabb, Vec3};
use crate::mesh::Mesh;
use crate::mesh::io::confidence_colour::{confidence_colour, confidence_scale};
use crate::mesh::io::ply::push_floats;
use serde_json::{Value, json};
use std::f64::consts::FRAC_1_SQRT_2;

/// Largest value of a channel.
const MAX_CHANNEL: f64 = 255.0;
/// Normals shorter than this have no direction.
const MIN_NORMAL_LENGTH: f64 = 1e-12;
/// Roughness of the material: matt, so that the colours stay visible.
const ROUGHNESS_FACTOR: f64 = 0.8;

/// The binary chunk with the buffer views and accessors that describe it.
#[derive(Default)]
struct GlbBuffers {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl GlbBuffers {
    /// Appends data with a buffer view and an accessor; returns the accessor's index.
    fn push(&mut self, data: &[u8], target: u32, accessor: Value) -> usize {
        self.views.push(json!({
            "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": data.len(), "target": target
        }));
        let mut accessor = accessor;
        accessor["bufferView"] = (self.views.len() - 1).into();
        self.accessors.push(accessor);
        self.bytes.extend_from_slice(data);
        self.accessors.len() - 1
    }
}

/// The bytes of a file with POSITION, NORMAL, COLOR_0 (if the mesh has sigma) and indices; the
/// comments are in the asset's extras.
pub(in crate::mesh::io) fn write(mesh: &Mesh, comments: &[String]) -> Vec<u8> {
    let mut buffers = GlbBuffers::default();
    let mut attributes = json!({
        "POSITION": push_positions(&mut buffers, mesh),
        "NORMAL": push_normals(&mut buffers, mesh)
    });
    if !mesh.sigma.is_empty() {
        attributes["COLOR_0"] = push_colours(&mut buffers, mesh).into();
    }
    let indices: Vec<u8> = mesh.triangles.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let count = mesh.triangles.len() * 3;
    let accessor =
        json!({"componentType": UNSIGNED_INT_COMPONENT, "count": count, "type": "SCALAR"});
    let indices = buffers.push(&indices, ELEMENT_ARRAY_BUFFER_TARGET, accessor);
    let document = json!({
        "asset": {"version": "2.0", "generator": GENERATOR_NAME, "extras": {"comments": comments}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        // z up to y up: a quarter turn back about x.
        "nodes": [{"mesh": 0, "rotation": [-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2]}],
        "meshes": [{"primitives": [{
            "attributes": attributes, "indices": indices, "material": 0, "mode": 4
        }]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": ROUGHNESS_FACTOR}}],
        "buffers": [{"byteLength": buffers.bytes.len()}],
        "bufferViews": buffers.views,
        "accessors": buffers.accessors
    });
    pack_chunks(document.to_string().into_bytes(), buffers.bytes)
}

/// Appends the positions; returns their accessor.
fn push_positions(buffers: &mut GlbBuffers, mesh: &Mesh) -> usize {
    let mut bytes = Vec::with_capacity(mesh.vertices.len() * 12);
    push_floats(&mut bytes, mesh.vertices.iter().flatten_vectors());
    // The bounds must be those of the rounded values.
    let rounded: Vec<Vec3> = mesh.vertices.iter().map(|v| v.map(|c| f64::from(c as f32))).collect();
    let Aabb { min, max } = Aabb::from_points(&rounded);
    let accessor = json!({
        "componentType": FLOAT_COMPONENT, "count": mesh.vertices.len(), "type": "VEC3",
        "min": min.as_slice(), "max": max.as_slice()
    });
    buffers.push(&bytes, ARRAY_BUFFER_TARGET, accessor)
}

/// Appends the normals; returns their accessor.
fn push_normals(buffers: &mut GlbBuffers, mesh: &Mesh) -> usize {
    // The format requires unit length.
    let normals = mesh.normals.iter().map(|n| {
        n.try_normalize(MIN_NORMAL_LENGTH).filter(|n| n.x.is_finite()).unwrap_or_else(Vec3::z)
    });
    let normals: Vec<Vec3> = normals.collect();
    let mut bytes = Vec::with_capacity(normals.len() * 12);
    push_floats(&mut bytes, normals.iter().flatten_vectors());
    let accessor =
        json!({"componentType": FLOAT_COMPONENT, "count": normals.len(), "type": "VEC3"});
    buffers.push(&bytes, ARRAY_BUFFER_TARGET, accessor)
}

/// Appends the colours of sigma; returns their accessor.
fn push_colours(buffers: &mut GlbBuffers, mesh: &Mesh) -> usize {
    let scale = confidence_scale(&mesh.sigma);
    let colours = mesh.sigma.iter().flat_map(|sigma| {
        let [r, g, b] = confidence_colour(*sigma, scale).map(srgb_to_linear);
        [r, g, b, u8::MAX]
    });
    let bytes: Vec<u8> = colours.collect();
    let accessor = json!({
        "componentType": UNSIGNED_BYTE_COMPONENT, "count": mesh.sigma.len(), "type": "VEC4", "normalized": true
    });
    buffers.push(&bytes, ARRAY_BUFFER_TARGET, accessor)
}

/// Converts a channel from sRGB to linear (IEC 61966-2-1), as glTF requires for vertex colours.
fn srgb_to_linear(channel: u8) -> u8 {
    let c = f64::from(channel) / MAX_CHANNEL;
    // The constants are those of the standard's transfer function.
    let linear = if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    (linear * MAX_CHANNEL).round() as u8
}

/// Single-precision coordinates of vectors.
trait FlattenVectors {
    fn flatten_vectors(self) -> impl Iterator<Item = f32>;
}

impl<'a, I: Iterator<Item = &'a Vec3>> FlattenVectors for I {
    fn flatten_vectors(self) -> impl Iterator<Item = f32> {
        self.flat_map(|v| [v.x as f32, v.y as f32, v.z as f32])
    }
}

/// Header and chunks; each chunk is padded to 4 bytes, JSON with spaces and data with zeros.
fn pack_chunks(mut json: Vec<u8>, mut binary: Vec<u8>) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let total = 12 + 8 + json.len() + 8 + binary.len();
    let mut bytes = Vec::with_capacity(total);
    bytes.extend_from_slice(GLB_MAGIC);
    for word in [2, total as u32, json.len() as u32, JSON_CHUNK] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.append(&mut json);
    for word in [binary.len() as u32, BINARY_CHUNK] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.append(&mut binary);
    bytes
}
