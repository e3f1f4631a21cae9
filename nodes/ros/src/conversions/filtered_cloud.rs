//! Filtered clouds.

use super::point_fields::{Column, check_layout, layout};
use puffer_core::geometry::{Cloud, Vec3};
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::std_msgs::msg::Header;

/// The fields of 32-bit floats.
const FLOAT_FIELDS: [&str; 7] = ["x", "y", "z", "normal_x", "normal_y", "normal_z", "sigma"];
/// The field with the number of measurements behind a point.
const SUPPORT_FIELD: &str = "support";

/// Reads an oriented cloud: points and normals, sigma (metres; NaN where the message has none) and
/// support (1 where the message has none).
///
/// # Errors
/// In words, what of the message does not fit.
pub fn cloud_from_message(message: &PointCloud2) -> Result<Cloud, String> {
    let count = check_layout(message)?;
    let (points, normals) = (
        read_vectors(message, &FLOAT_FIELDS[..3], count)?,
        read_vectors(message, &FLOAT_FIELDS[3..6], count)?,
    );
    if let Some(i) = points.iter().chain(&normals).position(|v| !v.iter().all(|c| c.is_finite())) {
        return Err(format!("point {} of the cloud or its normal is not finite", i % count));
    }
    let sigma = Column::find(message, FLOAT_FIELDS[6])?;
    let support = Column::find(message, SUPPORT_FIELD)?;
    Ok(Cloud {
        points,
        normals,
        sigma: (0..count).map(|i| sigma.as_ref().map_or(f64::NAN, |c| c.at(i))).collect(),
        support: (0..count).map(|i| support.as_ref().map_or(1, |c| c.at(i) as u16)).collect(),
    })
}

/// Reads `count` vectors, whose coordinates are in the named fields.
fn read_vectors(message: &PointCloud2, names: &[&str], count: usize) -> Result<Vec<Vec3>, String> {
    let columns: Vec<Column> =
        names.iter().map(|name| Column::require(message, name)).collect::<Result<_, _>>()?;
    Ok((0..count).map(|i| Vec3::from_fn(|axis, _| columns[axis].at(i))).collect())
}

/// The message of an oriented cloud: float32 x y z normal_x normal_y normal_z sigma, uint16
/// support.
pub fn cloud_message(cloud: &Cloud, header: Header) -> PointCloud2 {
    let (fields, point_step) = layout(&FLOAT_FIELDS, Some(SUPPORT_FIELD));
    let mut data = Vec::with_capacity(cloud.len() * point_step as usize);
    for i in 0..cloud.len() {
        let numbers =
            cloud.points[i].iter().chain(cloud.normals[i].iter()).chain([&cloud.sigma[i]]);
        data.extend(numbers.flat_map(|v| (*v as f32).to_le_bytes()));
        data.extend(cloud.support[i].to_le_bytes());
    }
    PointCloud2 {
        header,
        height: 1,
        width: cloud.len() as u32,
        fields,
        is_bigendian: false,
        point_step,
        row_step: point_step * cloud.len() as u32,
        data,
        is_dense: true,
    }
}
