//! Reading of GLB files: all triangles of the scene in one mesh.

use super::accessor::{Answer, Document, entry, whole};
use super::{BINARY, GENERATOR, JSON, MAGIC};
use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::mesh::io::polygons::{Polygons, weld};
use crate::{Error, Result};
use nalgebra::{Matrix4, Quaternion, Translation3, UnitQuaternion};
use serde_json::Value;
use std::path::Path;

/// Reads a mesh in metres with z up. Files of other programs, which split vertices along seams, are welded.
pub(in crate::mesh::io) fn parse(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let fail = |message: String| Error::format(path, message);
    let document = unpack(bytes).map_err(fail)?;
    refuse_compression(&document.json).map_err(fail)?;
    let mut scene = Scene::new(&document);
    // y up to z up: a quarter turn about x.
    let z_up = Matrix4::new(
        1.0, 0.0, 0.0, 0.0, //
        0.0, 0.0, -1.0, 0.0, //
        0.0, 1.0, 0.0, 0.0, //
        0.0, 0.0, 0.0, 1.0,
    );
    for root in roots(&document.json).map_err(fail)? {
        scene.add_nodes(root, z_up).map_err(fail)?;
    }
    if scene.mesh.triangles.is_empty() {
        return Err(fail("its scene holds no triangle".into()));
    }
    if !scene.all_have_normals {
        scene.mesh.normals.clear();
    }
    let own = document.json["asset"]["generator"] == GENERATOR;
    Ok(if own { scene.mesh } else { weld(&scene.mesh) })
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let b = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
}

fn unpack(bytes: &[u8]) -> Answer<Document<'_>> {
    if !bytes.starts_with(MAGIC) {
        return Err("is not a GLB file: it must start with 'glTF'".into());
    }
    match (word(bytes, 4), word(bytes, 8)) {
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
    let (mut at, mut json, mut data) = (12, None, None);
    while let (Some(length), Some(kind)) = (word(bytes, at), word(bytes, at + 4)) {
        let start = at + 8;
        let chunk = bytes.get(start..start + length as usize).ok_or_else(|| {
            format!(
                "the chunk at byte {at} asks for {length} bytes, past the end at byte {}",
                bytes.len()
            )
        })?;
        match kind {
            JSON if json.is_none() => json = Some(chunk),
            BINARY if data.is_none() => data = Some(chunk),
            _ => {}
        }
        at = start + length as usize;
    }
    let json = json.ok_or("has no JSON chunk")?;
    let json =
        serde_json::from_slice(json).map_err(|e| format!("its JSON chunk is broken: {e}"))?;
    Ok(Document { json, data: data.unwrap_or_default() })
}

fn refuse_compression(json: &Value) -> Answer<()> {
    let required = json["extensionsRequired"].as_array().map_or(&[][..], Vec::as_slice);
    // These change the look only.
    let harmless =
        |name: &str| name.starts_with("KHR_materials") || name.starts_with("KHR_texture");
    match required.iter().find(|name| !name.as_str().is_some_and(harmless)) {
        Some(name) => Err(format!("needs the extension {name}: save it without")),
        None => Ok(()),
    }
}

fn roots(json: &Value) -> Answer<Vec<usize>> {
    let number =
        |v: &Value| v.as_u64().map(|v| v as usize).ok_or("a node's number is wrong".into());
    if json["scenes"].is_array() {
        let scene = entry(json, "scenes", whole(json, "scene", Some(0))?)?;
        return scene["nodes"].as_array().into_iter().flatten().map(number).collect();
    }
    let nodes = json["nodes"].as_array().map_or(&[][..], Vec::as_slice);
    let children: Vec<usize> = nodes
        .iter()
        .flat_map(|n| n["children"].as_array().into_iter().flatten())
        .map(number)
        .collect::<Answer<_>>()?;
    Ok((0..nodes.len()).filter(|i| !children.contains(i)).collect())
}

struct Scene<'a> {
    document: &'a Document<'a>,
    mesh: Mesh,
    all_have_normals: bool,
    visited: Vec<bool>,
}

impl<'a> Scene<'a> {
    fn new(document: &'a Document<'a>) -> Scene<'a> {
        let nodes = document.json["nodes"].as_array().map_or(0, Vec::len);
        Scene {
            document,
            mesh: Mesh::default(),
            all_have_normals: true,
            visited: vec![false; nodes],
        }
    }

    /// Adds the node and all below it.
    fn add_nodes(&mut self, root: usize, world_from_root: Matrix4<f64>) -> Answer<()> {
        let mut open = vec![(root, world_from_root)];
        while let Some((index, world_from_parent)) = open.pop() {
            let node = entry(&self.document.json, "nodes", index)?;
            if std::mem::replace(&mut self.visited[index], true) {
                return Err(format!("node {index} has two parents: the nodes must form trees"));
            }
            let world_from_node = world_from_parent * local_transform(node)?;
            if !node["mesh"].is_null() {
                let mesh = entry(&self.document.json, "meshes", whole(node, "mesh", None)?)?;
                for primitive in mesh["primitives"].as_array().into_iter().flatten() {
                    self.add_primitive(primitive, &world_from_node)?;
                }
            }
            for child in node["children"].as_array().into_iter().flatten().rev() {
                let child = child.as_u64().ok_or("a node's number is wrong")?;
                open.push((child as usize, world_from_node));
            }
        }
        Ok(())
    }

    fn add_primitive(&mut self, primitive: &Value, world_from_mesh: &Matrix4<f64>) -> Answer<()> {
        let mode = whole(primitive, "mode", Some(4))?;
        if mode < 4 {
            return Ok(()); // Points and lines.
        }
        let attributes = &primitive["attributes"];
        let vertices = self.document.vectors(whole(attributes, "POSITION", None)?, "POSITION")?;
        let corners = match &primitive["indices"] {
            Value::Null => (0..vertices.len()).map(|i| i as f64).collect(),
            _ => self.document.indices(whole(primitive, "indices", None)?)?,
        };
        let triangles = triangles(&corners, mode, vertices.len())?;
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
                let normals =
                    self.document.vectors(whole(attributes, "NORMAL", None)?, "NORMAL")?;
                self.all_have_normals &= normals.len() == vertices.len();
                let turn = |n: &Vec3| (inverse.transpose() * n).try_normalize(0.0).unwrap_or(*n);
                self.mesh.normals.extend(normals.iter().map(turn));
            }
            _ => self.all_have_normals = false,
        }
        Ok(())
    }
}

fn triangles(corners: &[f64], mode: usize, vertices: usize) -> Answer<Vec<[u32; 3]>> {
    let mut polygons = Polygons::new(vertices);
    let mut push = |corners: &[f64]| polygons.push(corners).map_err(|e| format!("a triangle {e}"));
    match mode {
        4 => corners.chunks_exact(3).try_for_each(&mut push)?,
        5 => {
            for (i, c) in corners.windows(3).enumerate() {
                push(&if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] })?;
            }
        }
        6 => push(corners)?,
        _ => return Err(format!("has a primitive of the unknown mode {mode}")),
    }
    Ok(polygons.into_triangles())
}

fn local_transform(node: &Value) -> Answer<Matrix4<f64>> {
    let numbers = |key: &str, count: usize| -> Answer<Option<Vec<f64>>> {
        let Some(list) = node[key].as_array() else { return Ok(None) };
        let numbers: Option<Vec<f64>> = list.iter().map(Value::as_f64).collect();
        match numbers.filter(|n| n.len() == count) {
            Some(numbers) => Ok(Some(numbers)),
            None => Err(format!("a node's '{key}' must be {count} numbers")),
        }
    };
    if let Some(matrix) = numbers("matrix", 16)? {
        return Ok(Matrix4::from_column_slice(&matrix));
    }
    let mut transform = Matrix4::identity();
    if let Some(t) = numbers("translation", 3)? {
        transform *= Translation3::new(t[0], t[1], t[2]).to_homogeneous();
    }
    if let Some(q) = numbers("rotation", 4)? {
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q[3], q[0], q[1], q[2]));
        transform *= rotation.to_homogeneous();
    }
    if let Some(s) = numbers("scale", 3)? {
        transform *= Matrix4::new_nonuniform_scaling(&Vec3::new(s[0], s[1], s[2]));
    }
    Ok(transform)
}
