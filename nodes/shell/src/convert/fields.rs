//! Columns of numbers in a PointCloud2.

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
    /// What does not fit: a type that is unknown, or data shorter than the layout says.
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

    /// As [`Column::find`], but the field must be there.
    pub(super) fn require(cloud: &'a PointCloud2, name: &str) -> Result<Column<'a>, String> {
        Column::find(cloud, name)?.ok_or_else(|| {
            let has: Vec<&str> = cloud.fields.iter().map(|f| f.name.as_str()).collect();
            format!("the cloud has no field {name}; it has {}", has.join(", "))
        })
    }

    /// The number of point `index` of the cloud, row by row.
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

/// Checks that rows and data fit each other; the number of points.
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

/// Fields of 32-bit floats (and a 16-bit count, if one is named last) in a row; size of a point in bytes.
pub(super) fn layout(floats: &[&str], count: Option<&str>) -> (Vec<PointField>, u32) {
    let field = |name: &str, offset: u32, datatype: u8| PointField {
        name: name.to_owned(),
        offset,
        datatype,
        count: 1,
    };
    let mut fields: Vec<PointField> = floats
        .iter()
        .zip(0_u32..)
        .map(|(name, i)| field(name, 4 * i, PointField::FLOAT32))
        .collect();
    let end = 4 * floats.len() as u32;
    fields.extend(count.map(|name| field(name, end, PointField::UINT16)));
    (fields, end + if count.is_some() { 2 } else { 0 })
}
