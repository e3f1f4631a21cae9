//! Mesh and cloud files.

mod colour;
mod file;
mod glb;
mod obj;
pub(crate) mod ply;
mod polygons;
mod stl;
mod unit;

pub use colour::{confidence_colour, confidence_scale};
pub use unit::Unit;

pub(crate) use file::{read_bytes, write_bytes};
pub(crate) use unit::{check_extent, largest_extent};

use super::Mesh;
use crate::geometry::Cloud;
use crate::{Error, Result};
use std::path::Path;

#[derive(Clone, Copy)]
enum Format {
    Ply,
    Stl,
    Obj,
    Glb,
}

impl Format {
    fn of_extension(path: &Path) -> Option<Format> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "ply" => Some(Format::Ply),
            "stl" => Some(Format::Stl),
            "obj" => Some(Format::Obj),
            "glb" => Some(Format::Glb),
            _ => None,
        }
    }

    fn of_content(bytes: &[u8]) -> Option<Format> {
        let start = bytes.trim_ascii_start();
        let obj_words: [&[u8]; 6] = [b"v ", b"vn ", b"f ", b"o ", b"g ", b"mtllib "];
        if bytes.starts_with(b"ply") {
            Some(Format::Ply)
        } else if bytes.starts_with(b"glTF") {
            Some(Format::Glb)
        } else if start.starts_with(b"solid") {
            Some(Format::Stl)
        } else if start.starts_with(b"#") || obj_words.iter().any(|word| start.starts_with(word)) {
            Some(Format::Obj)
        } else {
            // A binary STL file has no mark of its own, but its count of facets agrees with its size.
            let b = bytes.get(80..84)?;
            let count = u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize;
            (bytes.len() == 84 + 50 * count).then_some(Format::Stl)
        }
    }
}

/// Reads a triangle mesh (coordinates as they stand in the file, metres by convention) from a PLY, STL, OBJ or
/// GLB file, told by the extension, or by the content where the extension is another.
///
/// Polygons are cut into fans; STL vertices of equal position are joined, and so are those of GLB files of
/// other programs; GLB's y up becomes z up. `sigma` and `observed` are read from PLY only; normals may be missing.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read, [`Error::Format`] if it is malformed or holds no triangle.
pub fn read_mesh(path: &Path) -> Result<Mesh> {
    parse_mesh(&read_bytes(path)?, path)
}

fn parse_mesh(bytes: &[u8], path: &Path) -> Result<Mesh> {
    if bytes.is_empty() {
        return Err(Error::format(path, "is empty"));
    }
    let format = Format::of_extension(path).or_else(|| Format::of_content(bytes));
    let mesh = match format {
        Some(Format::Ply) => ply::parse_mesh(bytes, path)?,
        Some(Format::Stl) => stl::parse(bytes, path)?,
        Some(Format::Obj) => obj::parse(bytes, path)?,
        Some(Format::Glb) => glb::parse(bytes, path)?,
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

/// Writes a mesh as PLY (binary little-endian), STL (binary), OBJ or GLB, told by the extension; the file
/// appears complete or not at all.
///
/// Coordinates are rounded to single precision. Missing normals are computed. PLY holds sigma, the colours made
/// of it ([`confidence_colour`] with [`confidence_scale`]) and `observed`, each where the mesh has it; GLB the
/// colours. `comments` stand in the header (PLY, OBJ), in the asset's extras (GLB); STL has room for part of the first.
///
/// # Errors
/// [`Error::Format`] if the extension is not known, [`Error::Input`] if the mesh is inconsistent, [`Error::Io`]
/// if it cannot be written (no space, no permission, no folder).
pub fn write_mesh(path: &Path, mesh: &Mesh, comments: &[String]) -> Result<()> {
    let format = Format::of_extension(path).ok_or_else(|| {
        Error::format(path, "the extension tells no known format; use .ply, .stl, .obj or .glb")
    })?;
    check_consistent(mesh)?;
    // A GLB file tells its length in 32 bits; a MiB is more than its header takes.
    let glb_size = mesh.vertices.len() * 28 + mesh.triangles.len() * 12 + (1 << 20);
    if matches!(format, Format::Glb) && u32::try_from(glb_size).is_err() {
        return Err(Error::format(path, "the mesh is too large for GLB (4 GiB); write a PLY"));
    }
    let mut mesh = std::borrow::Cow::Borrowed(mesh);
    if mesh.normals.is_empty() {
        mesh.to_mut().compute_normals();
    }
    let bytes = match format {
        Format::Ply => ply::write_mesh(&mesh, comments),
        Format::Stl => stl::write(&mesh, comments),
        Format::Obj => obj::write(&mesh, comments),
        Format::Glb => glb::write(&mesh, comments),
    };
    write_bytes(path, &bytes)
}

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
    // PLY's indices are signed.
    if count > i32::MAX as usize {
        return Err(Error::input(format!("{count} vertices are more than a file can index")));
    }
    match mesh.triangles.iter().flatten().find(|v| **v as usize >= count) {
        Some(v) => Err(Error::input(format!("a triangle names vertex {v}, but there are {count}"))),
        None => Ok(()),
    }
}

/// Reads registered points with normals from one PLY file: x y z and nx ny nz (or normal_x normal_y normal_z),
/// and, where there, sigma (else NaN) and support (else 1). Points without a finite position and normal are left out.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read, [`Error::Format`] if it is malformed, has no normals, or has an
/// extent over 10 m.
pub fn read_cloud(path: &Path) -> Result<Cloud> {
    read_cloud_in(path, Unit::M)
}

/// As [`read_cloud`], for a file with coordinates and sigma in `unit`; the cloud is in metres.
///
/// # Errors
/// As [`read_cloud`].
pub fn read_cloud_in(path: &Path, unit: Unit) -> Result<Cloud> {
    let mut cloud = ply::parse_cloud(&read_bytes(path)?, path)?;
    for point in &mut cloud.points {
        *point *= unit.metres();
    }
    for sigma in &mut cloud.sigma {
        *sigma *= unit.metres();
    }
    check_extent(largest_extent(cloud.points.iter().map(|p| (*p).into())), unit)
        .map_err(|message| Error::format(path, message))?;
    Ok(cloud)
}

/// Writes points with normals as binary little-endian PLY: float x y z nx ny nz sigma, ushort support.
///
/// # Errors
/// [`Error::Input`] if the cloud's vectors differ in length, [`Error::Io`] if the file cannot be written.
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
