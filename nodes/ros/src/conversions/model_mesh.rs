//! Meshes.

use puffer_core::geometry::Vec3;
use puffer_core::mesh::Mesh;
use puffer_msgs::msg::ModelMesh;
use puffer_msgs::std_msgs::msg::Header;

/// The message of a mesh.
pub fn mesh_message(mesh: &Mesh, header: Header) -> ModelMesh {
    ModelMesh {
        header,
        vertices: flatten(&mesh.vertices),
        triangles: mesh.triangles.as_flattened().to_vec(),
        normals: flatten(&mesh.normals),
        sigma: mesh.sigma.iter().map(|s| *s as f32).collect(),
        observed: mesh.observed.iter().map(|o| u8::from(*o)).collect(),
    }
}

/// The mesh of a message.
///
/// # Errors
/// In words, if the lengths of the lists do not fit each other, or a triangle names a vertex beyond
/// the last.
pub fn mesh_from_message(message: &ModelMesh) -> Result<Mesh, String> {
    let count = message.vertices.len() / 3;
    let is_consistent = message.vertices.len().is_multiple_of(3)
        && message.triangles.len().is_multiple_of(3)
        && is_absent_or(message.normals.len(), 3 * count)
        && is_absent_or(message.sigma.len(), count)
        && is_absent_or(message.observed.len(), count);
    if !is_consistent {
        return Err(format!(
            "the mesh has {} vertex and {} normal coordinates, {} triangle corners, {} sigma and {} observed: they \
             do not fit each other",
            message.vertices.len(),
            message.normals.len(),
            message.triangles.len(),
            message.sigma.len(),
            message.observed.len()
        ));
    }
    if let Some(vertex) = message.triangles.iter().find(|&&v| v as usize >= count) {
        return Err(format!("a triangle names vertex {vertex}, but there are {count}"));
    }
    let (triangles, _) = message.triangles.as_chunks::<3>();
    Ok(Mesh {
        vertices: unflatten(&message.vertices),
        triangles: triangles.to_vec(),
        normals: unflatten(&message.normals),
        sigma: message.sigma.iter().map(|s| f64::from(*s)).collect(),
        observed: message.observed.iter().map(|o| *o != 0).collect(),
    })
}

/// The coordinates of the vectors in a row, in single precision.
fn flatten(vectors: &[Vec3]) -> Vec<f32> {
    vectors.iter().flat_map(|v| v.iter().map(|c| *c as f32)).collect()
}

/// The vectors whose coordinates stand in a row.
fn unflatten(coordinates: &[f32]) -> Vec<Vec3> {
    let (triples, _) = coordinates.as_chunks::<3>();
    triples.iter().map(|t| Vec3::from(t.map(f64::from))).collect()
}

/// Whether an optional list is absent or has the length that is wanted.
fn is_absent_or(length: usize, wanted: usize) -> bool {
    length == 0 || length == wanted
}
