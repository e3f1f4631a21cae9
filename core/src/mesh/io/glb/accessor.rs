//! Accessors: typed views into the binary chunk (glTF 2.0, §3.6.2).

use super::{
    FLOAT_COMPONENT, UNSIGNED_BYTE_COMPONENT, UNSIGNED_INT_COMPONENT, UNSIGNED_SHORT_COMPONENT,
};
use crate::geometry::Vec3;
use crate::mesh::io::polygons::read_vector;
use serde_json::Value;

/// A result whose message the caller puts behind the file's name.
pub(super) type GlbResult<T> = std::result::Result<T, String>;

/// The JSON document of a file and the data that it describes.
pub(super) struct GlbDocument<'a> {
    pub(super) json: Value,
    pub(super) data: &'a [u8],
}

/// Entry `index` of the list `name`.
pub(super) fn list_entry<'v>(json: &'v Value, name: &str, index: usize) -> GlbResult<&'v Value> {
    let list = json[name].as_array().map_or(&[][..], Vec::as_slice);
    list.get(index).ok_or_else(|| format!("names {name}[{index}], but there are {}", list.len()))
}

/// The non-negative integer under `key`, or `default` if the key is missing.
pub(super) fn index_value(json: &Value, key: &str, default: Option<usize>) -> GlbResult<usize> {
    match &json[key] {
        Value::Null => default.ok_or_else(|| format!("lacks the number '{key}'")),
        value => value
            .as_u64()
            .and_then(|v| usize::try_from(v).ok())
            .ok_or_else(|| format!("'{key}' is {value}, not a whole number")),
    }
}

/// The rows of an accessor in the data.
struct AccessorRows<'a> {
    data: &'a [u8],
    component_type: u64,
    count: usize,
    /// Bytes from one row to the next.
    stride: usize,
    /// Bytes of a row.
    size: usize,
}

impl<'a> AccessorRows<'a> {
    fn iter(&self) -> impl Iterator<Item = &'a [u8]> {
        let (data, stride, size) = (self.data, self.stride, self.size);
        (0..self.count).map(move |i| &data[i * stride..i * stride + size])
    }
}

impl GlbDocument<'_> {
    /// Reads a list of float vectors; `what` names them in messages.
    pub(super) fn read_vectors(&self, accessor: usize, what: &str) -> GlbResult<Vec<Vec3>> {
        let rows = self.accessor_rows(accessor, "VEC3", 3)?;
        if rows.component_type != FLOAT_COMPONENT {
            return Err(format!(
                "{what} has component type {}, not float: save it without quantisation",
                rows.component_type
            ));
        }
        Ok(rows.iter().map(read_vector).collect())
    }

    /// Reads a list of indices.
    pub(super) fn read_indices(&self, accessor: usize) -> GlbResult<Vec<f64>> {
        let rows = self.accessor_rows(accessor, "SCALAR", 1)?;
        Ok(rows.iter().map(read_index).collect())
    }

    /// Checks an accessor of this type (such as VEC3, with this number of components) and finds its
    /// rows.
    fn accessor_rows(
        &self,
        index: usize,
        kind: &str,
        components: usize,
    ) -> GlbResult<AccessorRows<'_>> {
        let accessor = list_entry(&self.json, "accessors", index)?;
        if accessor["type"] != kind || !accessor["sparse"].is_null() {
            return Err(format!("accessors[{index}] must be a plain (not sparse) {kind}"));
        }
        let component_type = index_value(accessor, "componentType", None)? as u64;
        let size = match component_type {
            UNSIGNED_BYTE_COMPONENT => 1,
            UNSIGNED_SHORT_COMPONENT => 2,
            UNSIGNED_INT_COMPONENT => 4,
            FLOAT_COMPONENT if components > 1 => 4,
            _ => {
                return Err(format!(
                    "accessors[{index}] has the unfit component type {component_type}"
                ));
            }
        } * components;
        let view =
            list_entry(&self.json, "bufferViews", index_value(accessor, "bufferView", None)?)?;
        let buffer = list_entry(&self.json, "buffers", index_value(view, "buffer", None)?)?;
        if !buffer["uri"].is_null() || view["buffer"] != 0 {
            return Err("its data lie in another file: save it as one self-contained .glb".into());
        }
        let count = index_value(accessor, "count", None)?;
        let stride = index_value(view, "byteStride", Some(size))?;
        let view_start = index_value(view, "byteOffset", Some(0))?;
        let view_length = index_value(view, "byteLength", None)?;
        let start = index_value(accessor, "byteOffset", Some(0))?;
        let data = view_start
            .checked_add(view_length)
            .and_then(|end| self.data.get(view_start..end))
            .and_then(|view| view.get(start..));
        let needed = count.saturating_sub(1).checked_mul(stride).and_then(|n| n.checked_add(size));
        match (data, needed) {
            (Some(data), Some(needed))
                if stride >= size && (count == 0 || needed <= data.len()) =>
            {
                Ok(AccessorRows { data, component_type, count, stride, size })
            }
            _ => Err(format!(
                "accessors[{index}] asks for {count} entries of {size} bytes, {stride} bytes apart, which the {} \
                 bytes of data do not hold: the file is truncated or damaged",
                self.data.len()
            )),
        }
    }
}

/// An unsigned index of one, two or four bytes; NaN for another size, which no mesh accepts.
fn read_index(bytes: &[u8]) -> f64 {
    match *bytes {
        [a] => a.into(),
        [a, b] => u16::from_le_bytes([a, b]).into(),
        [a, b, c, d] => u32::from_le_bytes([a, b, c, d]).into(),
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Two vectors, 16 bytes apart from byte 4 on, and indices of each size behind them.
    fn data() -> Vec<u8> {
        let mut bytes = vec![0; 4];
        for vector in [[1.0f32, 2.0, 3.0, 9.0], [4.0, 5.0, 6.0, 9.0]] {
            bytes.extend(vector.iter().flat_map(|v| v.to_le_bytes()));
        }
        bytes.extend([7, 0, 200]);
        bytes.push(0);
        bytes.extend([1u16, 65535].iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend([3u32, 4_000_000_000].iter().flat_map(|v| v.to_le_bytes()));
        bytes
    }

    fn document(data: &[u8]) -> GlbDocument<'_> {
        let json = json!({
            "buffers": [{"byteLength": data.len()}],
            "bufferViews": [
                {"buffer": 0, "byteOffset": 4, "byteLength": 32, "byteStride": 16},
                {"buffer": 0, "byteOffset": 36, "byteLength": 16},
            ],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 2, "type": "VEC3"},
                {"bufferView": 1, "componentType": 5121, "count": 3, "type": "SCALAR"},
                {"bufferView": 1, "byteOffset": 4, "componentType": 5123, "count": 2, "type": "SCALAR"},
                {"bufferView": 1, "byteOffset": 8, "componentType": 5125, "count": 2, "type": "SCALAR"},
                {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                {"bufferView": 1, "componentType": 5126, "count": 1, "type": "SCALAR"},
                {"bufferView": 0, "componentType": 5126, "count": 1, "type": "VEC3", "sparse": {}},
            ],
        });
        GlbDocument { json, data }
    }

    #[test]
    fn strided_vectors_and_indices_of_every_size_are_read() {
        let data = data();
        let document = document(&data);
        let vectors = document.read_vectors(0, "POSITION").unwrap();
        assert_eq!(vectors, [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)]);
        assert_eq!(document.read_indices(1).unwrap(), [7.0, 0.0, 200.0]);
        assert_eq!(document.read_indices(2).unwrap(), [1.0, 65535.0]);
        assert_eq!(document.read_indices(3).unwrap(), [3.0, 4e9]);
    }

    #[test]
    fn accessors_that_do_not_fit_say_why() {
        let data = data();
        let document = document(&data);
        for (index, says) in [
            (4, "accessors[4] asks for 3 entries of 12 bytes, 16 bytes apart"),
            (6, "must be a plain (not sparse) VEC3"),
            (1, "must be a plain (not sparse) VEC3"),
            (7, "names accessors[7], but there are 7"),
        ] {
            let message = document.read_vectors(index, "POSITION").unwrap_err();
            assert!(message.contains(says), "{message}");
        }
        assert!(document.read_indices(5).unwrap_err().contains("unfit component type 5126"));
    }
}
