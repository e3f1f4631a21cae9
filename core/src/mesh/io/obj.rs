//! Wavefront OBJ files: vertices, normals and faces; all else is skipped.

use super::polygons::Polygons;
use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::{Error, Result};
use std::fmt::Write;
use std::path::Path;

type Corner = (f64, Option<f64>);

/// Reads a mesh. Its normals are kept if each vertex has one and only one.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let text = String::from_utf8_lossy(bytes);
    let (mut vertices, mut normals, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    for (number, line) in text.lines().enumerate() {
        let at = |message: String| Error::format(path, format!("line {}: {message}", number + 1));
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => vertices.push(vector(words, "vertex").map_err(at)?),
            Some("vn") => normals.push(vector(words, "normal").map_err(at)?),
            Some("f") => {
                let read = |word| corner(word, vertices.len(), normals.len());
                let corners = words.map(read).collect::<std::result::Result<Vec<Corner>, _>>();
                faces.push((number + 1, corners.map_err(at)?));
            }
            _ => {}
        }
    }
    let mut polygons = Polygons::new(vertices.len());
    let mut corners = Vec::new();
    for (line, face) in &faces {
        corners.clear();
        corners.extend(face.iter().map(|(vertex, _)| *vertex));
        polygons
            .push(&corners)
            .map_err(|e| Error::format(path, format!("line {line}: the face {e}")))?;
    }
    let corners = faces.iter().flat_map(|(_, face)| face);
    let normals = vertex_normals(vertices.len(), &normals, corners).unwrap_or_default();
    let triangles = polygons.finish(path)?;
    Ok(Mesh { normals, ..Mesh::new(vertices, triangles) })
}

fn vector<'a>(
    mut words: impl Iterator<Item = &'a str>,
    what: &str,
) -> std::result::Result<Vec3, String> {
    let mut number = || words.next()?.parse::<f64>().ok();
    match (number(), number(), number()) {
        (Some(x), Some(y), Some(z)) => Ok(Vec3::new(x, y, z)),
        _ => Err(format!("a {what} must have three numbers")),
    }
}

/// One corner, "v", "v/vt", "v//vn" or "v/vt/vn"; counted from 1, or backwards from -1. Given from 0.
fn corner(word: &str, vertices: usize, normals: usize) -> std::result::Result<Corner, String> {
    let index = |text: &str, count: usize| {
        let index: i64 = text.parse().map_err(|_| {
            format!("'{}' is not an index", word.chars().take(30).collect::<String>())
        })?;
        match index {
            0 => Err("index 0: OBJ counts from 1".to_owned()),
            1.. => Ok((index - 1) as f64),
            _ => Ok(count as f64 + index as f64),
        }
    };
    let mut parts = word.split('/');
    let vertex = index(parts.next().unwrap_or_default(), vertices)?;
    let normal = parts.nth(1).filter(|t| !t.is_empty()).map(|t| index(t, normals)).transpose()?;
    Ok((vertex, normal))
}

fn vertex_normals<'a>(
    count: usize,
    normals: &[Vec3],
    corners: impl Iterator<Item = &'a Corner>,
) -> Option<Vec<Vec3>> {
    let mut found: Vec<Option<Vec3>> = vec![None; count];
    for (vertex, normal) in corners {
        let normal = normals.get((*normal).filter(|n| *n >= 0.0)? as usize)?;
        let slot = found.get_mut(*vertex as usize)?;
        if slot.is_some_and(|other| other != *normal) {
            return None;
        }
        *slot = Some(*normal);
    }
    found.into_iter().collect()
}

/// The file's bytes, in the precision of the PLY file; normals are written with the vertices' indices.
pub(super) fn write(mesh: &Mesh, comments: &[String]) -> Vec<u8> {
    let mut text = String::with_capacity(mesh.vertices.len() * 80 + mesh.triangles.len() * 40);
    let mut line = |arguments: std::fmt::Arguments| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{arguments}");
    };
    for comment in comments.iter().flat_map(|comment| comment.lines()) {
        line(format_args!("# {comment}"));
    }
    for (keyword, vectors) in [("v", &mesh.vertices), ("vn", &mesh.normals)] {
        for v in vectors {
            line(format_args!("{keyword} {} {} {}", v.x as f32, v.y as f32, v.z as f32));
        }
    }
    for [a, b, c] in mesh.triangles.iter().map(|t| t.map(|v| v + 1)) {
        line(format_args!("f {a}//{a} {b}//{b} {c}//{c}"));
    }
    text.into_bytes()
}
