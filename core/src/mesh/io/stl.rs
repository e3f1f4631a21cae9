//! STL files, binary and ASCII. They hold no shared vertices: those of equal position are joined.

use super::polygons::weld;
use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::{Error, Result};
use std::path::Path;

const HEADER: usize = 80;
const FACET: usize = 50;

/// Reads a mesh.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let count = bytes.get(HEADER..HEADER + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let binary_size = |count: u32| HEADER + 4 + count as usize * FACET;
    // Binary files may start with "solid" as well: the size tells.
    let is_binary = count.is_some_and(|count| binary_size(count) == bytes.len());
    let vertices = if is_binary {
        binary(&bytes[HEADER + 4..])
    } else if bytes.trim_ascii_start().starts_with(b"solid") && looks_like_text(bytes) {
        ascii(bytes, path)?
    } else {
        let message = match count {
            Some(count) => format!(
                "is not an STL file, or is truncated: its count of {count} facets asks for {} bytes, but it has {}",
                binary_size(count),
                bytes.len()
            ),
            None => format!(
                "has {} bytes: too short for a binary STL file (84 at least), and an ASCII one starts with 'solid'",
                bytes.len()
            ),
        };
        return Err(Error::format(path, message));
    };
    if vertices.is_empty() {
        return Err(Error::format(path, "holds no facet"));
    }
    let triangles = (0..vertices.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Ok(weld(&Mesh::new(vertices, triangles)))
}

fn looks_like_text(bytes: &[u8]) -> bool {
    bytes.iter().take(1024).all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace() || *b >= 128)
}

fn binary(facets: &[u8]) -> Vec<Vec3> {
    let number = |b: &[u8]| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    facets
        .chunks_exact(FACET)
        .flat_map(|facet| facet[12..48].chunks_exact(12))
        .map(|b| Vec3::new(number(b), number(&b[4..]), number(&b[8..])))
        .collect()
}

fn ascii(bytes: &[u8], path: &Path) -> Result<Vec<Vec3>> {
    let text = String::from_utf8_lossy(bytes);
    let (mut vertices, mut closed, mut last) = (Vec::new(), true, 0);
    for (number, line) in text.lines().enumerate() {
        last = number + 1;
        let fail = |message: String| Err(Error::format(path, format!("line {last}: {message}")));
        let mut words = line.split_whitespace();
        match words.next().unwrap_or_default() {
            "vertex" => {
                let values: Option<Vec<f64>> =
                    words.map(|w| w.parse::<f32>().ok().map(f64::from)).collect();
                match values.as_deref() {
                    Some([x, y, z]) => vertices.push(Vec3::new(*x, *y, *z)),
                    _ => return fail("a vertex must have three numbers".into()),
                }
            }
            "facet" => closed = false,
            "endfacet" if vertices.len() % 3 == 0 => closed = true,
            "endfacet" => return fail("a facet must have three vertices".into()),
            "solid" | "endsolid" | "outer" | "endloop" | "" => {}
            word => {
                let word: String = word.chars().take(30).collect();
                return fail(format!("'{word}' is not a word of the STL format"));
            }
        }
    }
    if closed && vertices.len() % 3 == 0 {
        return Ok(vertices);
    }
    Err(Error::format(
        path,
        format!("ends at line {last} within facet {}: it is truncated", vertices.len() / 3),
    ))
}

/// The bytes of a binary file, with the first comment in its header.
pub(super) fn write(mesh: &Mesh, comments: &[String]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER + 4 + mesh.triangles.len() * FACET);
    // The first word must not be "solid".
    bytes.extend(b"binary STL, metres. ");
    bytes.extend(comments.first().map(String::as_bytes).unwrap_or_default());
    bytes.resize(HEADER, b' ');
    bytes.extend((mesh.triangles.len() as u32).to_le_bytes());
    for index in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(index);
        for vector in [mesh.triangle_normal(index), a, b, c] {
            bytes.extend(vector.iter().flat_map(|v| (*v as f32).to_le_bytes()));
        }
        bytes.extend([0, 0]);
    }
    bytes
}
