//! Wavefront OBJ files: vertices, normals and faces. Everything else in a file is skipped.

use super::polygons::PolygonFans;
use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::{Error, Result};
use std::fmt::Write;
use std::path::Path;

/// A corner of a face: the indices of its vertex and, if the file gives one, of its normal, counted
/// from 0.
#[derive(Clone, Copy)]
struct FaceCorner {
    vertex: f64,
    normal: Option<f64>,
}

/// Longest part of a word that messages show.
const MAX_SHOWN_CHARS: usize = 30;

/// Reads a mesh. Its normals are kept if each vertex has exactly one.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let text = String::from_utf8_lossy(bytes);
    let (mut vertices, mut normals, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    for (number, line) in text.lines().enumerate() {
        let line_number = number + 1;
        let mut words = line.split_whitespace();
        let parsed = match words.next() {
            Some("v") => parse_vector(words, "vertex").map(|v| vertices.push(v)),
            Some("vn") => parse_vector(words, "normal").map(|v| normals.push(v)),
            Some("f") => words
                .map(|word| parse_corner(word, vertices.len(), normals.len()))
                .collect::<std::result::Result<Vec<FaceCorner>, _>>()
                .map(|corners| faces.push((line_number, corners))),
            _ => Ok(()),
        };
        parsed.map_err(|message| Error::format(path, format!("line {line_number}: {message}")))?;
    }
    let mut polygons = PolygonFans::new(vertices.len());
    let mut corners = Vec::new();
    for (line, face) in &faces {
        corners.clear();
        corners.extend(face.iter().map(|corner| corner.vertex));
        polygons
            .push(&corners)
            .map_err(|e| Error::format(path, format!("line {line}: the face {e}")))?;
    }
    let corners = faces.iter().flat_map(|(_, face)| face);
    let normals = vertex_normals(vertices.len(), &normals, corners).unwrap_or_default();
    let triangles = polygons.finish(path)?;
    Ok(Mesh { normals, ..Mesh::new(vertices, triangles) })
}

/// Parses three numbers; further ones are ignored.
fn parse_vector<'a>(
    mut words: impl Iterator<Item = &'a str>,
    what: &str,
) -> std::result::Result<Vec3, String> {
    let mut vector = Vec3::zeros();
    for coordinate in vector.iter_mut() {
        let number = words.next().and_then(|word| word.parse().ok());
        *coordinate = number.ok_or_else(|| format!("a {what} must have three numbers"))?;
    }
    Ok(vector)
}

/// Parses a corner, which is "v", "v/vt", "v//vn" or "v/vt/vn". Indices count from 1, or backwards
/// from -1.
fn parse_corner(
    word: &str,
    vertices: usize,
    normals: usize,
) -> std::result::Result<FaceCorner, String> {
    let mut parts = word.split('/');
    let vertex = parse_index(parts.next().unwrap_or_default(), word, vertices)?;
    let normal = parts.nth(1).filter(|text| !text.is_empty());
    let normal = normal.map(|text| parse_index(text, word, normals)).transpose()?;
    Ok(FaceCorner { vertex, normal })
}

/// Parses an index of a corner `word` into a list of `count` items; the result counts from 0.
fn parse_index(text: &str, word: &str, count: usize) -> std::result::Result<f64, String> {
    let index: i64 = text.parse().map_err(|_| {
        let shown: String = word.chars().take(MAX_SHOWN_CHARS).collect();
        format!("'{shown}' is not an index")
    })?;
    match index {
        0 => Err("index 0: OBJ counts from 1".to_owned()),
        1.. => Ok((index - 1) as f64),
        _ => Ok(count as f64 + index as f64),
    }
}

/// The normal of each vertex; `None` if a vertex has none or several.
fn vertex_normals<'a>(
    count: usize,
    normals: &[Vec3],
    corners: impl Iterator<Item = &'a FaceCorner>,
) -> Option<Vec<Vec3>> {
    let mut found: Vec<Option<Vec3>> = vec![None; count];
    for corner in corners {
        let normal = normals.get(corner.normal.filter(|n| *n >= 0.0)? as usize)?;
        let slot = found.get_mut(corner.vertex as usize)?;
        if slot.is_some_and(|other| other != *normal) {
            return None;
        }
        *slot = Some(*normal);
    }
    found.into_iter().collect()
}

/// The bytes of a file in single precision; the normals have the indices of their vertices.
pub(super) fn write(mesh: &Mesh, comments: &[String]) -> Vec<u8> {
    let mut text = String::with_capacity(mesh.vertices.len() * 80 + mesh.triangles.len() * 40);
    for comment in comments.iter().flat_map(|comment| comment.lines()) {
        let _ = writeln!(text, "# {comment}"); // Writing to a string cannot fail.
    }
    for (keyword, vectors) in [("v", &mesh.vertices), ("vn", &mesh.normals)] {
        for v in vectors {
            let _ = writeln!(text, "{keyword} {} {} {}", v.x as f32, v.y as f32, v.z as f32);
        }
    }
    for [a, b, c] in mesh.triangles.iter().map(|t| t.map(|v| v + 1)) {
        let _ = writeln!(text, "f {a}//{a} {b}//{b} {c}//{c}");
    }
    text.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_shapes::torus;

    #[test]
    fn what_is_written_is_read_again_in_single_precision() {
        let mut mesh = torus(1.0, 0.3, 9, 5);
        mesh.compute_normals();
        let bytes = write(&mesh, &["one\ntwo".into()]);
        assert!(bytes.starts_with(b"# one\n# two\nv "));
        let read = parse(&bytes, Path::new("x.obj")).unwrap();
        assert_eq!(read.triangles, mesh.triangles);
        for (a, b) in [(&read.vertices, &mesh.vertices), (&read.normals, &mesh.normals)] {
            assert_eq!(a.len(), b.len());
            assert!(a.iter().zip(b).all(|(a, b)| a.map(|c| c as f32) == b.map(|c| c as f32)));
        }
    }

    #[test]
    fn corners_have_every_form_and_count_from_either_end() {
        for (word, vertex, normal) in [
            ("3", 2.0, None),
            ("3/9", 2.0, None),
            ("3//2", 2.0, Some(1.0)),
            ("1/7/2", 0.0, Some(1.0)),
            ("-1//-2", 9.0, Some(2.0)),
            ("3/", 2.0, None),
        ] {
            let corner = parse_corner(word, 10, 4).unwrap();
            assert_eq!((corner.vertex, corner.normal), (vertex, normal), "{word}");
        }
        for word in ["", "x", "1//x", "0", "1.5"] {
            assert!(parse_corner(word, 10, 4).is_err(), "{word}");
        }
    }

    #[test]
    fn normals_are_kept_only_if_each_vertex_has_one() {
        let corners: Vec<FaceCorner> =
            [0.0, 1.0, 0.0].map(|i| FaceCorner { vertex: i, normal: Some(i) }).into();
        let normals = [Vec3::x(), Vec3::y()];
        assert_eq!(vertex_normals(2, &normals, corners.iter()), Some(normals.to_vec()));
        assert_eq!(vertex_normals(3, &normals, corners.iter()), None, "a vertex has none");
        let two = [corners[0], FaceCorner { normal: Some(1.0), ..corners[0] }];
        assert_eq!(vertex_normals(1, &normals, two.iter()), None, "a vertex has two");
    }
}
