//! The fields of a PointCloud2, as columns of numbers.

use puffer_msgs::sensor_msgs::msg::{PointCloud2, PointField};

/// One field of a cloud, ready to be read point by point.
pub(super) struct Column<'a> {
    cloud: &'a PointCloud2,
    offset: usize,
    datatype: u8,
    size: usize,
}

impl<'a> Column<'a> {
    /// The field `name`; `None` if the cloud has none.
    ///
    /// # Errors
    /// In words, if the datatype is unknown or the field lies outside of the point.
    pub(super) fn find(cloud: &'a PointCloud2, name: &str) -> Result<Option<Column<'a>>, String> {
        let Some(field) = cloud.fields.iter().find(|f| f.name == name) else { return Ok(None) };
        let size = match field.datatype {
            PointField::INT8 | PointField::UINT8 => 1,
            PointField::INT16 | PointField::UINT16 => 2,
            PointField::INT32 | PointField::UINT32 | PointField::FLOAT32 => 4,
            PointField::FLOAT64 => 8,
            other => return Err(format!("field {name} has the unknown datatype {other}")),
        };
        let offset = field.offset as usize;
        if offset + size > cloud.point_step as usize {
            return Err(format!(
                "field {name} ends at byte {} of points of {} bytes",
                offset + size,
                cloud.point_step
            ));
        }
        Ok(Some(Column { cloud, offset, datatype: field.datatype, size }))
    }

    /// As [`Column::find`], but a missing field is an error.
    pub(super) fn require(cloud: &'a PointCloud2, name: &str) -> Result<Column<'a>, String> {
        Column::find(cloud, name)?.ok_or_else(|| {
            let has: Vec<&str> = cloud.fields.iter().map(|f| f.name.as_str()).collect();
            format!("the cloud has no field {name}; it has {}", has.join(", "))
        })
    }

    /// The value of point `index`; points count row by row.
    pub(super) fn at(&self, index: usize) -> f64 {
        let width = self.cloud.width as usize;
        let start = index / width * self.cloud.row_step as usize
            + index % width * self.cloud.point_step as usize
            + self.offset;
        let mut bytes = [0_u8; 8];
        bytes[..self.size].copy_from_slice(&self.cloud.data[start..start + self.size]);
        if self.cloud.is_bigendian {
            bytes[..self.size].reverse();
        }
        let [a, b, c, d, ..] = bytes;
        match self.datatype {
            PointField::INT8 => f64::from(a as i8),
            PointField::UINT8 => f64::from(a),
            PointField::INT16 => f64::from(i16::from_le_bytes([a, b])),
            PointField::UINT16 => f64::from(u16::from_le_bytes([a, b])),
            PointField::INT32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            PointField::UINT32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            PointField::FLOAT32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            _ => f64::from_le_bytes(bytes),
        }
    }
}

/// Checks that the rows fit the data; returns the number of points.
pub(super) fn check_layout(cloud: &PointCloud2) -> Result<usize, String> {
    let (width, height) = (cloud.width as usize, cloud.height as usize);
    let (step, row) = (cloud.point_step as usize, cloud.row_step as usize);
    let fits = width.checked_mul(step).is_some_and(|least| least <= row)
        && height.checked_mul(row).is_some_and(|all| all <= cloud.data.len());
    if !fits {
        return Err(format!(
            "the cloud says {height} rows of {row} bytes with {width} points of {step} bytes each, but holds {} \
             bytes",
            cloud.data.len()
        ));
    }
    width.checked_mul(height).ok_or_else(|| "the cloud is too large".to_owned())
}

/// The layout of points of 32-bit floats, followed by a 16-bit count if one is named: the fields,
/// and the size of a point in bytes.
pub(super) fn layout(floats: &[&str], count: Option<&str>) -> (Vec<PointField>, u32) {
    let mut fields: Vec<PointField> = floats
        .iter()
        .zip(0_u32..)
        .map(|(name, i)| point_field(name, 4 * i, PointField::FLOAT32))
        .collect();
    let end = 4 * floats.len() as u32;
    fields.extend(count.map(|name| point_field(name, end, PointField::UINT16)));
    (fields, end + if count.is_some() { 2 } else { 0 })
}

fn point_field(name: &str, offset: u32, datatype: u8) -> PointField {
    PointField { name: name.to_owned(), offset, datatype, count: 1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_datatype_is_read_in_both_byte_orders() {
        for (datatype, little, expected) in [
            (PointField::INT8, vec![0xfe], -2.0),
            (PointField::UINT8, vec![0xfe], 254.0),
            (PointField::INT16, vec![0xfe, 0xff], -2.0),
            (PointField::UINT16, vec![0x01, 0x02], 513.0),
            (PointField::INT32, vec![0xfe, 0xff, 0xff, 0xff], -2.0),
            (PointField::UINT32, vec![0, 0, 0, 0x80], 2_147_483_648.0),
            (PointField::FLOAT32, 0.25_f32.to_le_bytes().to_vec(), 0.25),
            (PointField::FLOAT64, (-0.1_f64).to_le_bytes().to_vec(), -0.1),
        ] {
            let step = 1 + little.len() as u32;
            let mut cloud = PointCloud2 { width: 1, height: 1, ..PointCloud2::default() };
            (cloud.point_step, cloud.row_step) = (step, step);
            cloud.fields = vec![point_field("v", 1, datatype)];
            for is_bigendian in [false, true] {
                let mut bytes = little.clone();
                if is_bigendian {
                    bytes.reverse();
                }
                cloud.is_bigendian = is_bigendian;
                cloud.data = [&[0x77], &bytes[..]].concat();
                assert_eq!(check_layout(&cloud), Ok(1));
                assert_eq!(Column::require(&cloud, "v").unwrap().at(0), expected);
            }
        }
    }

    #[test]
    fn a_layout_has_floats_in_a_row_and_a_count_behind_them() {
        let (fields, size) = layout(&["x", "y"], Some("n"));
        let offsets: Vec<_> = fields.iter().map(|f| (&*f.name, f.offset, f.datatype)).collect();
        let float = PointField::FLOAT32;
        assert_eq!(offsets, [("x", 0, float), ("y", 4, float), ("n", 8, PointField::UINT16)]);
        assert_eq!(size, 10);
        assert_eq!(layout(&["x"], None).1, 4);
    }

    #[test]
    fn sizes_that_overflow_are_refused() {
        let mut cloud = PointCloud2 { width: u32::MAX, height: u32::MAX, ..PointCloud2::default() };
        cloud.point_step = u32::MAX;
        assert!(check_layout(&cloud).is_err());
    }
}
