//! Meshes.

use puffer_core::geometry::Vec3;
use puffer_core::mesh::Mesh;
use puffer_msgs::msg::ModelMesh;
use puffer_msgs::std_msgs::msg::Header;

/// The mesh as a message.
pub fn mesh_message(mesh: &Mesh, header: Header) -> ModelMesh {
    let numbers =
        |vectors: &[Vec3]| vectors.iter().flat_map(|v| v.iter().map(|c| *c as f32)).collect();
    ModelMesh {
        header,
        vertices: numbers(&mesh.vertices),
        triangles: mesh.triangles.as_flattened().to_vec(),
        normals: numbers(&mesh.normals),
        sigma: mesh.sigma.iter().map(|s| *s as f32).collect(),
        observed: mesh.observed.iter().map(|o| u8::from(*o)).collect(),
    }
}

/// The mesh of a message.
///
/// # Errors
/// Lists of lengths that do not fit each other, or a triangle that names a vertex beyond the last, in words.
pub fn mesh_from_message(message: &ModelMesh) -> Result<Mesh, String> {
    let vectors = |numbers: &[f32]| -> Vec<Vec3> {
        let (triples, _) = numbers.as_chunks::<3>();
        triples.iter().map(|t| Vec3::from(t.map(f64::from))).collect()
    };
    let count = message.vertices.len() / 3;
    let fits = |length: usize, wanted: usize| length == 0 || length == wanted;
    let good = message.vertices.len().is_multiple_of(3)
        && message.triangles.len().is_multiple_of(3)
        && fits(message.normals.len(), 3 * count)
        && fits(message.sigma.len(), count)
        && fits(message.observed.len(), count);
    if !good {
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
        vertices: vectors(&message.vertices),
        triangles: triangles.to_vec(),
        normals: vectors(&message.normals),
        sigma: message.sigma.iter().map(|s| f64::from(*s)).collect(),
        observed: message.observed.iter().map(|o| *o != 0).collect(),
    })
}
