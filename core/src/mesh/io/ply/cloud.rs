//! Clouds with normals in PLY files.

use super::mesh::{is_normal, normal_columns, position_columns};
use super::{PlyHeader, parse, push_floats};
use crate::geometry::{Cloud, Vec3};
use crate::{Error, Result};
use std::path::Path;

/// Normals shorter than this have no reliable direction in single precision.
const MIN_NORMAL_LENGTH: f64 = 1e-6;
/// Bytes of a point: seven floats and the support.
const POINT_BYTES: usize = 30;

/// Reads the points that have a finite position and a normal.
pub(in crate::mesh::io) fn parse_cloud(bytes: &[u8], path: &Path) -> Result<Cloud> {
    let ply = parse(bytes, path, &is_cloud_property)?;
    let vertex = ply.require_element(path, "vertex", "a cloud needs vertices")?;
    let [x, y, z] = position_columns(vertex, path)?;
    let [nx, ny, nz] = normal_columns(vertex).ok_or_else(|| {
        Error::format(
            path,
            "has no normals (nx ny nz or normal_x normal_y normal_z), so its inside and outside are unknown: \
             give a scan folder with poses.json instead, or add normals",
        )
    })?;
    let (sigma, support) = (vertex.scalar_column(&["sigma"]), vertex.scalar_column(&["support"]));
    let mut cloud = Cloud::default();
    for i in 0..vertex.count {
        let point = Vec3::new(x.scalar_at(i), y.scalar_at(i), z.scalar_at(i));
        let normal = Vec3::new(nx.scalar_at(i), ny.scalar_at(i), nz.scalar_at(i))
            .try_normalize(MIN_NORMAL_LENGTH);
        if let Some(normal) = normal.filter(|n| n.iter().chain(point.iter()).all(|v| v.is_finite()))
        {
            let sigma = sigma.map_or(f64::NAN, |column| column.scalar_at(i));
            cloud.push(
                point,
                normal,
                sigma,
                support.map_or(1, |column| column.scalar_at(i) as u16),
            );
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

/// Whether a cloud is made of this property.
fn is_cloud_property(element: &str, property: &str) -> bool {
    element == "vertex"
        && (is_normal(property) || ["x", "y", "z", "sigma", "support"].contains(&property))
}

/// The bytes of a file with x y z nx ny nz sigma support.
pub(in crate::mesh::io) fn write_cloud(cloud: &Cloud, comments: &[String]) -> Vec<u8> {
    let mut header = PlyHeader::new(comments);
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
    header.add_element("vertex", cloud.len(), &properties);
    let mut bytes = header.into_bytes();
    bytes.reserve(cloud.len() * POINT_BYTES);
    for (i, point) in cloud.points.iter().enumerate() {
        push_floats(&mut bytes, point.iter().chain(cloud.normals[i].iter()).map(|v| *v as f32));
        push_floats(&mut bytes, [cloud.sigma[i] as f32]);
        bytes.extend_from_slice(&cloud.support[i].to_le_bytes());
    }
    bytes
}
