//! Oriented clouds in PLY files.

use super::mesh::{is_normal, normals, positions};
use super::{Layout, parse, push_floats};
use crate::geometry::{Cloud, Vec3};
use crate::{Error, Result};
use std::path::Path;

/// Reads the points that have a finite position and a normal.
pub(in crate::mesh::io) fn parse_cloud(bytes: &[u8], path: &Path) -> Result<Cloud> {
    let wanted = |element: &str, property: &str| {
        element == "vertex"
            && (is_normal(property) || ["x", "y", "z", "sigma", "support"].contains(&property))
    };
    let ply = parse(bytes, path, &wanted)?;
    let vertex = ply.require(path, "vertex", "a cloud needs vertices")?;
    let [x, y, z] = positions(vertex, path)?;
    let [nx, ny, nz] = normals(vertex).ok_or_else(|| {
        Error::format(
            path,
            "has no normals (nx ny nz or normal_x normal_y normal_z), so its inside and outside are unknown: \
             give a scan folder with poses.json instead, or add normals",
        )
    })?;
    let (sigma, support) = (vertex.scalar(&["sigma"]), vertex.scalar(&["support"]));
    let mut cloud = Cloud::default();
    for i in 0..vertex.count {
        let point = Vec3::new(x.get(i), y.get(i), z.get(i));
        let normal = Vec3::new(nx.get(i), ny.get(i), nz.get(i)).try_normalize(1e-6);
        if let Some(normal) = normal.filter(|n| n.iter().chain(point.iter()).all(|v| v.is_finite()))
        {
            let sigma = sigma.map_or(f64::NAN, |column| column.get(i));
            cloud.push(point, normal, sigma, support.map_or(1, |column| column.get(i) as u16));
        }
    }
    if cloud.is_empty() {
        return Err(Error::format(
            path,
            format!("none of its {} points has a finite position and normal", vertex.count),
        ));
    }
    Ok(cloud)
}

/// The file's bytes: x y z nx ny nz sigma support.
pub(in crate::mesh::io) fn write_cloud(cloud: &Cloud, comments: &[String]) -> Vec<u8> {
    let mut layout = Layout::new(comments);
    let properties = [
        "float x",
        "float y",
        "float z",
        "float nx",
        "float ny",
        "float nz",
        "float sigma",
        "ushort support",
    ];
    layout.element("vertex", cloud.len(), &properties);
    let mut bytes = layout.into_bytes();
    bytes.reserve(cloud.len() * 30);
    for (i, point) in cloud.points.iter().enumerate() {
        push_floats(&mut bytes, point.iter().chain(cloud.normals[i].iter()).map(|v| *v as f32));
        push_floats(&mut bytes, [cloud.sigma[i] as f32]);
        bytes.extend_from_slice(&cloud.support[i].to_le_bytes());
    }
    bytes
}
