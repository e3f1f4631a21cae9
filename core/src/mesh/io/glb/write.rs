//! Writing of GLB files.

use super::{ARRAY_BUFFER, BINARY, ELEMENT_ARRAY_BUFFER, FLOAT, GENERATOR, JSON, MAGIC};
use super::{UNSIGNED_BYTE, UNSIGNED_INT};
use crate::geometry::{Aabb, Vec3};
use crate::mesh::Mesh;
use crate::mesh::io::colour::{confidence_colour, confidence_scale};
use crate::mesh::io::ply::push_floats;
use serde_json::{Value, json};
use std::f64::consts::FRAC_1_SQRT_2;

#[derive(Default)]
struct Buffers {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffers {
    /// Adds a view with its accessor and gives the accessor's index.
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

/// The file's bytes: POSITION, NORMAL, COLOR_0 (where the mesh has sigma) and indices; comments stand in the
/// asset's extras.
pub(in crate::mesh::io) fn write(mesh: &Mesh, comments: &[String]) -> Vec<u8> {
    let mut buffers = Buffers::default();
    let mut attributes = json!({
        "POSITION": positions(&mut buffers, mesh),
        "NORMAL": normals(&mut buffers, mesh)
    });
    if !mesh.sigma.is_empty() {
        attributes["COLOR_0"] = colours(&mut buffers, mesh).into();
    }
    let indices: Vec<u8> = mesh.triangles.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let count = mesh.triangles.len() * 3;
    let accessor = json!({"componentType": UNSIGNED_INT, "count": count, "type": "SCALAR"});
    let indices = buffers.push(&indices, ELEMENT_ARRAY_BUFFER, accessor);
    let document = json!({
        "asset": {"version": "2.0", "generator": GENERATOR, "extras": {"comments": comments}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        // Turns z up to y up: a quarter turn back about x.
        "nodes": [{"mesh": 0, "rotation": [-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2]}],
        "meshes": [{"primitives": [{
            "attributes": attributes, "indices": indices, "material": 0, "mode": 4
        }]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.8}}],
        "buffers": [{"byteLength": buffers.bytes.len()}],
        "bufferViews": buffers.views,
        "accessors": buffers.accessors
    });
    pack(document.to_string().into_bytes(), buffers.bytes)
}

fn positions(buffers: &mut Buffers, mesh: &Mesh) -> usize {
    let mut bytes = Vec::with_capacity(mesh.vertices.len() * 12);
    push_floats(&mut bytes, mesh.vertices.iter().flatten_vectors());
    // The bounds must be those of the rounded values.
    let rounded: Vec<Vec3> = mesh.vertices.iter().map(|v| v.map(|c| f64::from(c as f32))).collect();
    let Aabb { min, max } = Aabb::of(&rounded);
    let accessor = json!({
        "componentType": FLOAT, "count": mesh.vertices.len(), "type": "VEC3",
        "min": min.as_slice(), "max": max.as_slice()
    });
    buffers.push(&bytes, ARRAY_BUFFER, accessor)
}

fn normals(buffers: &mut Buffers, mesh: &Mesh) -> usize {
    // The format asks for unit length.
    let unit =
        |n: &Vec3| n.try_normalize(1e-12).filter(|n| n.x.is_finite()).unwrap_or_else(Vec3::z);
    let normals: Vec<Vec3> = mesh.normals.iter().map(unit).collect();
    let mut bytes = Vec::with_capacity(normals.len() * 12);
    push_floats(&mut bytes, normals.iter().flatten_vectors());
    let accessor = json!({"componentType": FLOAT, "count": normals.len(), "type": "VEC3"});
    buffers.push(&bytes, ARRAY_BUFFER, accessor)
}

fn colours(buffers: &mut Buffers, mesh: &Mesh) -> usize {
    let scale = confidence_scale(&mesh.sigma);
    let linear = |sigma: &f64| {
        let [r, g, b] = confidence_colour(*sigma, scale).map(linear);
        [r, g, b, 255]
    };
    let bytes: Vec<u8> = mesh.sigma.iter().flat_map(linear).collect();
    let accessor = json!({
        "componentType": UNSIGNED_BYTE, "count": mesh.sigma.len(), "type": "VEC4", "normalized": true
    });
    buffers.push(&bytes, ARRAY_BUFFER, accessor)
}

/// sRGB to linear (IEC 61966-2-1), as glTF wants vertex colours.
fn linear(channel: u8) -> u8 {
    let c = f64::from(channel) / 255.0;
    let linear = if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    (linear * 255.0).round() as u8
}

trait FlattenVectors {
    fn flatten_vectors(self) -> impl Iterator<Item = f32>;
}

impl<'a, I: Iterator<Item = &'a Vec3>> FlattenVectors for I {
    fn flatten_vectors(self) -> impl Iterator<Item = f32> {
        self.flat_map(|v| [v.x as f32, v.y as f32, v.z as f32])
    }
}

/// Header and chunks, each padded to 4 bytes: JSON with spaces, the data with zeros.
fn pack(mut json: Vec<u8>, mut binary: Vec<u8>) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let total = 12 + 8 + json.len() + 8 + binary.len();
    let mut bytes = Vec::with_capacity(total);
    bytes.extend_from_slice(MAGIC);
    for word in [2, total as u32, json.len() as u32, JSON] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.append(&mut json);
    for word in [binary.len() as u32, BINARY] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.append(&mut binary);
    bytes
}
