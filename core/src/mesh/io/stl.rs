//! STL files, binary and ASCII. The format has no shared vertices: vertices of equal position are
//! merged.

use super::polygons::{read_vector, weld_vertices};
use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::{Error, Result};
use std::path::Path;

/// Bytes of the header of a binary file.
const HEADER_BYTES: usize = 80;
/// Bytes of the count of facets behind the header.
const COUNT_BYTES: usize = 4;
/// Bytes of a facet: normal and three vertices as floats, and an attribute of two bytes.
const FACET_BYTES: usize = 50;
/// Bytes of a vector of three floats.
const VECTOR_BYTES: usize = 12;
/// Bytes from which a file is judged to be text.
const TEXT_PROBE_BYTES: usize = 1024;
/// Longest part of a word that messages show.
const MAX_SHOWN_CHARS: usize = 30;

/// The count of facets that a binary file states; `None` if it is too short.
pub(super) fn facet_count(bytes: &[u8]) -> Option<u32> {
    let b = bytes.get(HEADER_BYTES..HEADER_BYTES + COUNT_BYTES)?;
    Some(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
}

/// Size of a binary file with this count of facets.
pub(super) fn binary_size(count: u32) -> usize {
    HEADER_BYTES + COUNT_BYTES + count as usize * FACET_BYTES
}

/// Reads a mesh; vertices of equal position are merged.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let count = facet_count(bytes);
    // Binary files may start with "solid" as well, so the size decides.
    let is_binary = count.is_some_and(|count| binary_size(count) == bytes.len());
    let vertices = if is_binary {
        parse_binary(&bytes[HEADER_BYTES + COUNT_BYTES..])
    } else if bytes.trim_ascii_start().starts_with(b"solid") && looks_like_text(bytes) {
        parse_ascii(bytes, path)?
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
    Ok(weld_vertices(&Mesh::new(vertices, triangles)))
}

/// Whether the beginning of the file is text.
fn looks_like_text(bytes: &[u8]) -> bool {
    bytes
        .iter()
        .take(TEXT_PROBE_BYTES)
        .all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace() || *b >= 128)
}

/// The vertices of the facets of a binary file, three for each facet.
fn parse_binary(facets: &[u8]) -> Vec<Vec3> {
    facets
        .chunks_exact(FACET_BYTES)
        .flat_map(|facet| facet[VECTOR_BYTES..4 * VECTOR_BYTES].chunks_exact(VECTOR_BYTES))
        .map(read_vector)
        .collect()
}

/// The vertices of the facets of an ASCII file, three for each facet.
fn parse_ascii(bytes: &[u8], path: &Path) -> Result<Vec<Vec3>> {
    let text = String::from_utf8_lossy(bytes);
    let (mut vertices, mut is_facet_closed, mut last) = (Vec::new(), true, 0);
    for (number, line) in text.lines().enumerate() {
        last = number + 1;
        let mut words = line.split_whitespace();
        match words.next().unwrap_or_default() {
            "vertex" => {
                let values: Option<Vec<f64>> =
                    words.map(|w| w.parse::<f32>().ok().map(f64::from)).collect();
                match values.as_deref() {
                    Some([x, y, z]) => vertices.push(Vec3::new(*x, *y, *z)),
                    _ => return Err(line_error(path, last, "a vertex must have three numbers")),
                }
            }
            "facet" => is_facet_closed = false,
            "endfacet" if vertices.len() % 3 == 0 => is_facet_closed = true,
            "endfacet" => {
                return Err(line_error(path, last, "a facet must have three vertices"));
            }
            "solid" | "endsolid" | "outer" | "endloop" | "" => {}
            word => {
                let word: String = word.chars().take(MAX_SHOWN_CHARS).collect();
                let message = format!("'{word}' is not a word of the STL format");
                return Err(line_error(path, last, &message));
            }
        }
    }
    if is_facet_closed && vertices.len() % 3 == 0 {
        return Ok(vertices);
    }
    Err(Error::format(
        path,
        format!("ends at line {last} within facet {}: it is truncated", vertices.len() / 3),
    ))
}

/// An error in a line of an ASCII file, counted from 1.
fn line_error(path: &Path, line: usize, message: &str) -> Error {
    Error::format(path, format!("line {line}: {message}"))
}

/// The bytes of a binary file; its header contains the beginning of the first comment.
pub(super) fn write(mesh: &Mesh, comments: &[String]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(binary_size(mesh.triangles.len() as u32));
    // The first word must not be "solid".
    bytes.extend(b"binary STL, metres. ");
    bytes.extend(comments.first().map(String::as_bytes).unwrap_or_default());
    bytes.resize(HEADER_BYTES, b' ');
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_shapes::cuboid;

    fn unit_box() -> Mesh {
        cuboid(Vec3::zeros(), Vec3::new(1.0, 0.5, 0.25))
    }

    #[test]
    fn a_binary_file_has_its_size_and_is_read_again() {
        let mesh = unit_box();
        let bytes = write(&mesh, &["solid comment".into()]);
        assert_eq!(bytes.len(), 84 + 50 * 12);
        assert_eq!((facet_count(&bytes), binary_size(12)), (Some(12), bytes.len()));
        assert!(bytes.starts_with(b"binary STL, metres. solid comment "));
        // The normal of the first facet, at z = 0.
        assert_eq!(read_vector(&bytes[84..96]), -Vec3::z());
        let read = parse(&bytes, Path::new("x.stl")).unwrap();
        assert_eq!((read.vertices.len(), read.triangles.len()), (8, 12));
        assert_eq!(read.volume(), mesh.volume());
    }

    #[test]
    fn a_binary_file_that_starts_with_solid_is_told_by_its_size() {
        let mut bytes = write(&unit_box(), &[]);
        bytes[..6].copy_from_slice(b"solid ");
        assert_eq!(parse(&bytes, Path::new("x.stl")).unwrap().triangles.len(), 12);
        bytes.pop();
        let error = parse(&bytes, Path::new("x.stl")).unwrap_err().to_string();
        assert!(error.contains("asks for 684 bytes, but it has 683"), "{error}");
    }

    #[test]
    fn ascii_and_binary_give_the_same_mesh() {
        let mesh = unit_box();
        let mut text = String::from("solid box\n");
        for i in 0..mesh.triangles.len() {
            text += "facet normal 0 0 0\nouter loop\n";
            for v in mesh.corners(i) {
                text += &format!("vertex {} {} {}\n", v.x, v.y, v.z);
            }
            text += "endloop\nendfacet\n";
        }
        text += "endsolid box\n";
        let ascii = parse(text.as_bytes(), Path::new("x.stl")).unwrap();
        assert_eq!(ascii, parse(&write(&mesh, &[]), Path::new("x.stl")).unwrap());
        for (from, to, says) in [
            ("vertex 0 0 0", "vertex 0 0", "line 4: a vertex must have three numbers"),
            ("outer", "outter", "line 3: 'outter' is not a word of the STL format"),
            ("vertex 0 0 0\n", "", "line 7: a facet must have three vertices"),
            ("endfacet\nendsolid box\n", "", "within facet 12: it is truncated"),
        ] {
            let bad = text.replacen(from, to, 1);
            let error = parse(bad.as_bytes(), Path::new("x.stl")).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }
}
