//! Mesh and cloud files: PLY, STL, OBJ and GLB.
//!
//! ```
//! use puffer_core::geometry::Vec3;
//! use puffer_core::mesh::Mesh;
//! use puffer_core::mesh::io::{read_mesh, write_mesh};
//!
//! let corners = vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()];
//! let mesh = Mesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]);
//! # let folder = tempfile::tempdir().map_err(|e| puffer_core::Error::input(e.to_string()))?;
//! let path = folder.path().join("tetrahedron.ply");
//! write_mesh(&path, &mesh, &["a comment".to_owned()])?;
//! let read = read_mesh(&path)?;
//! assert_eq!((read.vertices, read.triangles), (mesh.vertices, mesh.triangles));
//! # Ok::<(), puffer_core::Error>(())
//! ```

mod atomic_file;
mod confidence_colour;
mod glb;
mod obj;
pub(crate) mod ply;
mod polygons;
mod stl;
mod unit;

pub use confidence_colour::{confidence_colour, confidence_scale};
pub use unit::Unit;

pub(crate) use atomic_file::{read_bytes, write_bytes};
pub(crate) use unit::{check_extent, trimmed_extent};

use super::Mesh;
use crate::geometry::Cloud;
use crate::{Error, Result};
use std::path::Path;

/// Words with which an OBJ file may start.
const OBJ_KEYWORDS: [&[u8]; 6] = [b"v ", b"vn ", b"f ", b"o ", b"g ", b"mtllib "];
/// Bytes of a vertex in a GLB file: position, normal and colour.
const GLB_VERTEX_BYTES: usize = 28;
/// Bytes of a triangle in a GLB file.
const GLB_TRIANGLE_BYTES: usize = 12;
/// A MiB is more than the header and the JSON chunk of a GLB file take.
const MAX_GLB_HEADER_BYTES: usize = 1 << 20;

/// A format of mesh files.
#[derive(Clone, Copy)]
enum MeshFormat {
    Ply,
    Stl,
    Obj,
    Glb,
}

impl MeshFormat {
    /// The format that the extension names.
    fn from_extension(path: &Path) -> Option<MeshFormat> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "ply" => Some(MeshFormat::Ply),
            "stl" => Some(MeshFormat::Stl),
            "obj" => Some(MeshFormat::Obj),
            "glb" => Some(MeshFormat::Glb),
            _ => None,
        }
    }

    /// The format that the content shows.
    fn from_content(bytes: &[u8]) -> Option<MeshFormat> {
        let start = bytes.trim_ascii_start();
        if bytes.starts_with(b"ply") {
            Some(MeshFormat::Ply)
        } else if bytes.starts_with(b"glTF") {
            Some(MeshFormat::Glb)
        } else if start.starts_with(b"solid") {
            Some(MeshFormat::Stl)
        } else if start.starts_with(b"#") || OBJ_KEYWORDS.iter().any(|word| start.starts_with(word))
        {
            Some(MeshFormat::Obj)
        } else {
            // A binary STL file has no signature, but its count of facets agrees with its size.
            let count = stl::facet_count(bytes)?;
            (bytes.len() == stl::binary_size(count)).then_some(MeshFormat::Stl)
        }
    }
}

/// Reads a triangle mesh from a PLY, STL, OBJ or GLB file.
///
/// The extension tells the format; if it is unknown, the content does. Coordinates are those of the
/// file, which are metres by convention. Polygons are split into fans of triangles. Vertices of
/// equal position are merged in STL files and in GLB files of other programs. GLB's y up becomes z
/// up. `sigma` and `observed` are read from PLY only; normals may be missing.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read, [`Error::Format`] if it is malformed or holds no
/// triangle.
pub fn read_mesh(path: &Path) -> Result<Mesh> {
    parse_mesh(&read_bytes(path)?, path)
}

/// Parses the content of a mesh file; `path` tells the format and names the file in messages.
fn parse_mesh(bytes: &[u8], path: &Path) -> Result<Mesh> {
    if bytes.is_empty() {
        return Err(Error::format(path, "is empty"));
    }
    let format = MeshFormat::from_extension(path).or_else(|| MeshFormat::from_content(bytes));
    let mesh = match format {
        Some(MeshFormat::Ply) => ply::parse_mesh(bytes, path)?,
        Some(MeshFormat::Stl) => stl::parse(bytes, path)?,
        Some(MeshFormat::Obj) => obj::parse(bytes, path)?,
        Some(MeshFormat::Glb) => glb::parse(bytes, path)?,
        None => {
            return Err(Error::format(
                path,
                "is of no known format; ply, stl, obj and glb are read",
            ));
        }
    };
    polygons::check_finite(&mesh, path)?;
    Ok(mesh)
}

/// Writes a mesh as PLY (binary little-endian), STL (binary), OBJ or GLB; the extension selects the
/// format.
///
/// The file appears complete or not at all. Coordinates are rounded to single precision. Missing
/// normals are computed. PLY files contain sigma, the colours that follow from it
/// ([`confidence_colour`] with [`confidence_scale`]) and `observed` if the mesh has them; GLB files
/// contain the colours. The `comments` are written to the header (PLY, OBJ) or to the extras of the
/// asset (GLB); STL has room for a part of the first one.
///
/// # Errors
/// [`Error::Format`] if the extension is not known, [`Error::Input`] if the mesh is inconsistent,
/// [`Error::Io`] if it cannot be written (no space, no permission, no folder).
pub fn write_mesh(path: &Path, mesh: &Mesh, comments: &[String]) -> Result<()> {
    let format = MeshFormat::from_extension(path).ok_or_else(|| {
        Error::format(path, "the extension tells no known format; use .ply, .stl, .obj or .glb")
    })?;
    check_consistent(mesh)?;
    // A GLB file states its length in 32 bits.
    let glb_size = mesh.vertices.len() * GLB_VERTEX_BYTES
        + mesh.triangles.len() * GLB_TRIANGLE_BYTES
        + MAX_GLB_HEADER_BYTES;
    if matches!(format, MeshFormat::Glb) && u32::try_from(glb_size).is_err() {
        return Err(Error::format(path, "the mesh is too large for GLB (4 GiB); write a PLY"));
    }
    let mut mesh = std::borrow::Cow::Borrowed(mesh);
    if mesh.normals.is_empty() {
        mesh.to_mut().compute_normals();
    }
    let bytes = match format {
        MeshFormat::Ply => ply::write_mesh(&mesh, comments),
        MeshFormat::Stl => stl::write(&mesh, comments),
        MeshFormat::Obj => obj::write(&mesh, comments),
        MeshFormat::Glb => glb::write(&mesh, comments),
    };
    write_bytes(path, &bytes)
}

/// Returns an error for a mesh that cannot be written.
fn check_consistent(mesh: &Mesh) -> Result<()> {
    let count = mesh.vertices.len();
    for (name, length) in [
        ("normals", mesh.normals.len()),
        ("sigma", mesh.sigma.len()),
        ("observed", mesh.observed.len()),
    ] {
        if length != 0 && length != count {
            return Err(Error::input(format!("the mesh has {count} vertices but {length} {name}")));
        }
    }
    if mesh.triangles.is_empty() {
        return Err(Error::input("the mesh has no triangle: there is nothing to write"));
    }
    // The indices of PLY files are signed 32-bit integers.
    if count > i32::MAX as usize {
        return Err(Error::input(format!("{count} vertices are more than a file can index")));
    }
    match mesh.triangles.iter().flatten().find(|v| **v as usize >= count) {
        Some(v) => Err(Error::input(format!("a triangle names vertex {v}, but there are {count}"))),
        None => Ok(()),
    }
}

/// Reads registered points with normals from one PLY file.
///
/// The file has x y z and nx ny nz (or normal_x normal_y normal_z), and may have sigma (otherwise
/// NaN) and support (otherwise 1). Points without a finite position and normal are left out.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read, [`Error::Format`] if it is malformed, has no normals,
/// or has an extent over 10 m.
pub fn read_cloud(path: &Path) -> Result<Cloud> {
    read_cloud_with_unit(path, Unit::Metre)
}

/// As [`read_cloud`], for a file with coordinates and sigma in `unit`. The returned cloud is in
/// metres.
///
/// # Errors
/// As [`read_cloud`].
pub fn read_cloud_with_unit(path: &Path, unit: Unit) -> Result<Cloud> {
    let mut cloud = ply::parse_cloud(&read_bytes(path)?, path)?;
    for point in &mut cloud.points {
        *point *= unit.metres_per_unit();
    }
    for sigma in &mut cloud.sigma {
        *sigma *= unit.metres_per_unit();
    }
    check_extent(trimmed_extent(cloud.points.iter().map(|p| (*p).into())), unit)
        .map_err(|message| Error::format(path, message))?;
    Ok(cloud)
}

/// Writes points with normals as binary little-endian PLY: float x y z nx ny nz sigma, ushort
/// support.
///
/// # Errors
/// [`Error::Input`] if the cloud's vectors differ in length, [`Error::Io`] if the file cannot be
/// written.
pub fn write_cloud(path: &Path, cloud: &Cloud, comments: &[String]) -> Result<()> {
    let lengths = [cloud.normals.len(), cloud.sigma.len(), cloud.support.len()];
    if lengths.iter().any(|length| *length != cloud.len()) {
        return Err(Error::input(format!(
            "the cloud has {} points but {} normals, {} sigma and {} support",
            cloud.len(),
            lengths[0],
            lengths[1],
            lengths[2]
        )));
    }
    write_bytes(path, &ply::write_cloud(cloud, comments))
}

#[cfg(test)]
mod tests;
