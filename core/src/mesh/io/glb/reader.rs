//! Reading of GLB files: all triangles of the scene in one mesh.

use super::accessor::{GlbDocument, GlbResult, index_value, list_entry};
use super::{BINARY_CHUNK, GENERATOR_NAME, GLB_MAGIC, JSON_CHUNK};
use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::mesh::io::polygons::{PolygonFans, weld_vertices};
use crate::{Error, Result};
use nalgebra::{Matrix4, Quaternion, Translation3, UnitQuaternion};
use serde_json::Value;
use std::path::Path;

/// Bytes of the header: magic, version and length.
const HEADER_BYTES: usize = 12;
/// Bytes before a chunk: its length and type.
const CHUNK_HEADER_BYTES: usize = 8;
// Modes of primitives (glTF 2.0, §5.24).
const TRIANGLES_MODE: usize = 4;
const STRIP_MODE: usize = 5;
const FAN_MODE: usize = 6;

/// Reads a mesh in metres with z up. In files of other programs, which split vertices along seams,
/// vertices of equal position are merged.
pub(in crate::mesh::io) fn parse(bytes: &[u8], path: &Path) -> Result<Mesh> {
    parse_scene(bytes).map_err(|message| Error::format(path, message))
}

/// Reads the mesh of all nodes of the scene.
fn parse_scene(bytes: &[u8]) -> GlbResult<Mesh> {
    let document = unpack_chunks(bytes)?;
    check_extensions(&document.json)?;
    let mut scene = SceneReader::new(&document);
    // y up to z up: a quarter turn about x.
    let z_up = Matrix4::new(
        1.0, 0.0, 0.0, 0.0, //
        0.0, 0.0, -1.0, 0.0, //
        0.0, 1.0, 0.0, 0.0, //
        0.0, 0.0, 0.0, 1.0,
    );
    for root in root_nodes(&document.json)? {
        scene.add_nodes(root, z_up)?;
    }
    if scene.mesh.triangles.is_empty() {
        return Err("its scene holds no triangle".into());
    }
    if !scene.all_have_normals {
        scene.mesh.normals.clear();
    }
    let is_own = document.json["asset"]["generator"] == GENERATOR_NAME;
    Ok(if is_own { scene.mesh } else { weld_vertices(&scene.mesh) })
}

/// The little-endian word at byte `at`; `None` beyond the end.
fn read_u32(bytes: &[u8], at: usize) -> Option<u32> {
    let b = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
}

/// Checks the header and finds the JSON and the binary chunk.
fn unpack_chunks(bytes: &[u8]) -> GlbResult<GlbDocument<'_>> {
    if !bytes.starts_with(GLB_MAGIC) {
        return Err("is not a GLB file: it must start with 'glTF'".into());
    }
    match (read_u32(bytes, 4), read_u32(bytes, 8)) {
        (Some(2), Some(total)) if total as usize <= bytes.len() => {}
        (Some(2), total) => {
            return Err(format!(
                "has {} bytes, but its header tells {}: it is truncated",
                bytes.len(),
                total.unwrap_or_default()
            ));
        }
        (version, _) => {
            return Err(format!("has glTF version {}; 2 is read", version.unwrap_or_default()));
        }
    }
    let (mut at, mut json, mut data) = (HEADER_BYTES, None, None);
    while let (Some(length), Some(kind)) = (read_u32(bytes, at), read_u32(bytes, at + 4)) {
        let start = at + CHUNK_HEADER_BYTES;
        let chunk = bytes.get(start..start + length as usize).ok_or_else(|| {
            format!(
                "the chunk at byte {at} asks for {length} bytes, past the end at byte {}",
                bytes.len()
            )
        })?;
        match kind {
            JSON_CHUNK if json.is_none() => json = Some(chunk),
            BINARY_CHUNK if data.is_none() => data = Some(chunk),
            _ => {}
        }
        at = start + length as usize;
    }
    let json = json.ok_or("has no JSON chunk")?;
    let json =
        serde_json::from_slice(json).map_err(|e| format!("its JSON chunk is broken: {e}"))?;
    Ok(GlbDocument { json, data: data.unwrap_or_default() })
}

/// Returns an error if the file requires an extension that changes more than the appearance.
fn check_extensions(json: &Value) -> GlbResult<()> {
    let required = json["extensionsRequired"].as_array().map_or(&[][..], Vec::as_slice);
    match required.iter().find(|name| !name.as_str().is_some_and(changes_appearance_only)) {
        Some(name) => Err(format!("needs the extension {name}: save it without")),
        None => Ok(()),
    }
}

fn changes_appearance_only(extension: &str) -> bool {
    extension.starts_with("KHR_materials") || extension.starts_with("KHR_texture")
}

/// The root nodes of the default scene, or of all nodes if the file has no scenes.
fn root_nodes(json: &Value) -> GlbResult<Vec<usize>> {
    if json["scenes"].is_array() {
        let scene = list_entry(json, "scenes", index_value(json, "scene", Some(0))?)?;
        return scene["nodes"].as_array().into_iter().flatten().map(node_index).collect();
    }
    let nodes = json["nodes"].as_array().map_or(&[][..], Vec::as_slice);
    let children: Vec<usize> = nodes
        .iter()
        .flat_map(|n| n["children"].as_array().into_iter().flatten())
        .map(node_index)
        .collect::<GlbResult<_>>()?;
    Ok((0..nodes.len()).filter(|i| !children.contains(i)).collect())
}

/// The index of a node in a list of nodes.
fn node_index(value: &Value) -> GlbResult<usize> {
    value.as_u64().map(|v| v as usize).ok_or("a node's number is wrong".into())
}

/// Collects the triangles of nodes in one mesh.
struct SceneReader<'a> {
    document: &'a GlbDocument<'a>,
    mesh: Mesh,
    all_have_normals: bool,
    visited: Vec<bool>,
}

impl<'a> SceneReader<'a> {
    fn new(document: &'a GlbDocument<'a>) -> SceneReader<'a> {
        let nodes = document.json["nodes"].as_array().map_or(0, Vec::len);
        SceneReader {
            document,
            mesh: Mesh::default(),
            all_have_normals: true,
            visited: vec![false; nodes],
        }
    }

    /// Adds a node and its descendants.
    fn add_nodes(&mut self, root: usize, world_from_root: Matrix4<f64>) -> GlbResult<()> {
        let mut stack = vec![(root, world_from_root)];
        while let Some((index, world_from_parent)) = stack.pop() {
            let node = list_entry(&self.document.json, "nodes", index)?;
            if std::mem::replace(&mut self.visited[index], true) {
                return Err(format!("node {index} has two parents: the nodes must form trees"));
            }
            let world_from_node = world_from_parent * local_transform(node)?;
            if !node["mesh"].is_null() {
                let mesh =
                    list_entry(&self.document.json, "meshes", index_value(node, "mesh", None)?)?;
                for primitive in mesh["primitives"].as_array().into_iter().flatten() {
                    self.add_primitive(primitive, &world_from_node)?;
                }
            }
            for child in node["children"].as_array().into_iter().flatten().rev() {
                stack.push((node_index(child)?, world_from_node));
            }
        }
        Ok(())
    }

    /// Adds the triangles of a primitive; points and lines are skipped.
    fn add_primitive(
        &mut self,
        primitive: &Value,
        world_from_mesh: &Matrix4<f64>,
    ) -> GlbResult<()> {
        let mode = index_value(primitive, "mode", Some(TRIANGLES_MODE))?;
        if mode < TRIANGLES_MODE {
            return Ok(()); // Points and lines.
        }
        let attributes = &primitive["attributes"];
        let vertices =
            self.document.read_vectors(index_value(attributes, "POSITION", None)?, "POSITION")?;
        let corners = match &primitive["indices"] {
            Value::Null => (0..vertices.len()).map(|i| i as f64).collect(),
            _ => self.document.read_indices(index_value(primitive, "indices", None)?)?,
        };
        let triangles = primitive_triangles(&corners, mode, vertices.len())?;
        let linear = world_from_mesh.fixed_view::<3, 3>(0, 0).into_owned();
        let shift = world_from_mesh.fixed_view::<3, 1>(0, 3).into_owned();
        let first = u32::try_from(self.mesh.vertices.len())
            .ok()
            .filter(|first| first.checked_add(vertices.len() as u32).is_some())
            .ok_or("has more vertices than 32 bits can count")?;
        // A mirroring node turns the triangles inside out.
        let mirrored = linear.determinant() < 0.0;
        self.mesh.triangles.extend(triangles.into_iter().map(|[a, b, c]| {
            let triangle = if mirrored { [a, c, b] } else { [a, b, c] };
            triangle.map(|v| v + first)
        }));
        self.mesh.vertices.extend(vertices.iter().map(|v| linear * v + shift));
        match (&attributes["NORMAL"], linear.try_inverse()) {
            (Value::Number(_), Some(inverse)) => {
                let normals = self
                    .document
                    .read_vectors(index_value(attributes, "NORMAL", None)?, "NORMAL")?;
                self.all_have_normals &= normals.len() == vertices.len();
                // Normals transform by the inverse transpose.
                self.mesh.normals.extend(
                    normals
                        .iter()
                        .map(|n| (inverse.transpose() * n).try_normalize(0.0).unwrap_or(*n)),
                );
            }
            _ => self.all_have_normals = false,
        }
        Ok(())
    }
}

/// Splits the corners of a primitive into triangles by its mode: a list, a strip or a fan.
fn primitive_triangles(corners: &[f64], mode: usize, vertices: usize) -> GlbResult<Vec<[u32; 3]>> {
    let mut polygons = PolygonFans::new(vertices);
    let pushed = match mode {
        TRIANGLES_MODE => corners.chunks_exact(3).try_for_each(|c| polygons.push(c)),
        // Every other triangle of a strip runs the other way round.
        STRIP_MODE => corners.windows(3).enumerate().try_for_each(|(i, c)| {
            polygons.push(&if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] })
        }),
        FAN_MODE => polygons.push(corners),
        _ => return Err(format!("has a primitive of the unknown mode {mode}")),
    };
    pushed.map_err(|e| format!("a triangle {e}"))?;
    Ok(polygons.into_triangles())
}

/// The list of `count` numbers under `key` of a node; `None` if the key is missing.
fn node_numbers(node: &Value, key: &str, count: usize) -> GlbResult<Option<Vec<f64>>> {
    let Some(list) = node[key].as_array() else { return Ok(None) };
    let numbers: Option<Vec<f64>> = list.iter().map(Value::as_f64).collect();
    match numbers.filter(|n| n.len() == count) {
        Some(numbers) => Ok(Some(numbers)),
        None => Err(format!("a node's '{key}' must be {count} numbers")),
    }
}

/// The transform `parent_from_node`.
fn local_transform(node: &Value) -> GlbResult<Matrix4<f64>> {
    if let Some(matrix) = node_numbers(node, "matrix", 16)? {
        return Ok(Matrix4::from_column_slice(&matrix));
    }
    let mut transform = Matrix4::identity();
    if let Some(t) = node_numbers(node, "translation", 3)? {
        transform *= Translation3::new(t[0], t[1], t[2]).to_homogeneous();
    }
    if let Some(q) = node_numbers(node, "rotation", 4)? {
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q[3], q[0], q[1], q[2]));
        transform *= rotation.to_homogeneous();
    }
    if let Some(s) = node_numbers(node, "scale", 3)? {
        transform *= Matrix4::new_nonuniform_scaling(&Vec3::new(s[0], s[1], s[2]));
    }
    Ok(transform)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn lists_strips_and_fans_become_triangles_of_one_orientation() {
        let corners = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        let list = primitive_triangles(&corners, TRIANGLES_MODE, 6).unwrap();
        assert_eq!(list, [[0, 1, 2], [3, 4, 5]]);
        let strip = primitive_triangles(&corners[..5], STRIP_MODE, 6).unwrap();
        assert_eq!(strip, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        let fan = primitive_triangles(&corners[..5], FAN_MODE, 6).unwrap();
        assert_eq!(fan, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        assert!(primitive_triangles(&corners, 7, 6).unwrap_err().contains("unknown mode 7"));
        let error = primitive_triangles(&corners, TRIANGLES_MODE, 5).unwrap_err();
        assert!(error.contains("a triangle names vertex 5"), "{error}");
    }

    #[test]
    fn a_node_translates_after_it_rotates_and_scales() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let node = json!({
            "translation": [1.0, 2.0, 3.0], "rotation": [0.0, 0.0, half, half], "scale": [2.0, 3.0, 4.0]
        });
        let transform = local_transform(&node).unwrap();
        // x is scaled by 2 and turned to y.
        let moved = transform.transform_point(&nalgebra::Point3::new(1.0, 0.0, 1.0));
        assert!((moved.coords - Vec3::new(1.0, 4.0, 7.0)).norm() < 1e-12, "{moved}");
        let columns: Vec<f64> = (0..16).map(f64::from).collect();
        let matrix = local_transform(&json!({ "matrix": columns })).unwrap();
        assert_eq!(matrix[(0, 1)], 4.0);
        let error = local_transform(&json!({"scale": [1.0, 2.0]})).unwrap_err();
        assert_eq!(error, "a node's 'scale' must be 3 numbers");
    }

    #[test]
    fn roots_are_those_of_the_scene_or_the_nodes_without_parent() {
        let nodes = json!([{"children": [2]}, {}, {}]);
        assert_eq!(root_nodes(&json!({ "nodes": nodes })).unwrap(), [0, 1]);
        let scenes =
            json!({"nodes": nodes, "scenes": [{"nodes": [1]}, {"nodes": [0]}], "scene": 1});
        assert_eq!(root_nodes(&scenes).unwrap(), [0]);
    }

    #[test]
    fn only_extensions_of_the_appearance_may_be_required() {
        let allowed =
            json!({"extensionsRequired": ["KHR_materials_unlit", "KHR_texture_transform"]});
        assert!(check_extensions(&allowed).is_ok() && check_extensions(&json!({})).is_ok());
        let refused = json!({"extensionsRequired": ["KHR_draco_mesh_compression"]});
        assert!(check_extensions(&refused).unwrap_err().contains("KHR_draco_mesh_compression"));
    }
}
