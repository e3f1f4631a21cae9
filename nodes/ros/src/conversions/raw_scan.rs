//! SerializedPayload scans.

use super::point_fields::{Column, check_layout, layout};
use puffer_core::geometry::Scan;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::std_msgs::msg::Header;

/// The fields of a point.
const POINT_FIELDS: [&str; 3] = ["x", "y", "z"];
/// The fields of the origin of a point's ray (viewpoint).
const ORIGIN_FIELDS: [&str; 3] = ["vp_x", "vp_y", "vp_z"];

/// Reads a scan: x y z, and vp_x vp_y vp_z where the message has them (metres, sensor frame). A
/// message with one row counts as not organised.
///
/// # Errors
/// In words, what of the message does not fit.
pub fn scan_from_message(cloud: &PointCloud2) -> Result<Scan, String> {
    let count = check_layout(cloud)?;
    let points = read_triples(cloud, POINT_FIELDS, count)?;
    let has_origins = Column::find(cloud, ORIGIN_FIELDS[0])?.is_some();
    let origins = if has_origins { read_triples(cloud, ORIGIN_FIELDS, count)? } else { Vec::new() };
    let width = if cloud.height > 1 { cloud.width as usize } else { 0 };
    Ok(Scan { points, width, origins })
}

/// Reads `count` triples of numbers from the named fields.
fn read_triples(
    cloud: &PointCloud2,
    names: [&str; 3],
    count: usize,
) -> Result<Vec<[f32; 3]>, String> {
    let [x, y, z] = names.map(|name| Column::require(cloud, name));
    let (x, y, z) = (x?, y?, z?);
    Ok((0..count).map(|i| [x.at(i) as f32, y.at(i) as f32, z.at(i) as f32]).collect())
}

/// The message of a scan: float32 x y z, and vp_x vp_y vp_z where the scan has origins.
pub fn scan_message(scan: &Scan, header: Header) -> PointCloud2 {
    let has_origins = !scan.origins.is_empty();
    let names: Vec<&str> = POINT_FIELDS
        .into_iter()
        .chain(if has_origins { &ORIGIN_FIELDS[..] } else { &[] }.iter().copied())
        .collect();
    let (fields, point_step) = layout(&names, None);
    let mut data = Vec::with_capacity(scan.points.len() * point_step as usize);
    for (i, point) in scan.points.iter().enumerate() {
        data.extend(point.iter().flat_map(|v| v.to_le_bytes()));
        if has_origins {
            data.extend(scan.origins[i].iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    let (width, height) = match scan.width {
        0 => (scan.points.len(), 1),
        width => (width, scan.height()),
    };
    PointCloud2 {
        header,
        height: height as u32,
        width: width as u32,
        fields,
        is_bigendian: false,
        point_step,
        row_step: point_step * width as u32,
        data,
        is_dense: scan.points.as_flattened().iter().all(|v| v.is_finite()),
    }
}
