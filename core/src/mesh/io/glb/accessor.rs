//! Accessors: typed views into the binary chunk (glTF 2.0, §3.6.2).

use super::{FLOAT, UNSIGNED_BYTE, UNSIGNED_INT, UNSIGNED_SHORT};
use crate::geometry::Vec3;
use serde_json::Value;

/// Messages are put behind the file's name by the caller.
pub(super) type Answer<T> = std::result::Result<T, String>;

/// The document and the data that it describes.
pub(super) struct Document<'a> {
    pub(super) json: Value,
    pub(super) data: &'a [u8],
}

/// Entry `index` of the list `name`.
pub(super) fn entry<'v>(json: &'v Value, name: &str, index: usize) -> Answer<&'v Value> {
    let list = json[name].as_array().map_or(&[][..], Vec::as_slice);
    list.get(index).ok_or_else(|| format!("names {name}[{index}], but there are {}", list.len()))
}

/// A whole number; `default` where the key is missing.
pub(super) fn whole(json: &Value, key: &str, default: Option<usize>) -> Answer<usize> {
    match &json[key] {
        Value::Null => default.ok_or_else(|| format!("lacks the number '{key}'")),
        value => value
            .as_u64()
            .and_then(|v| usize::try_from(v).ok())
            .ok_or_else(|| format!("'{key}' is {value}, not a whole number")),
    }
}

/// The rows of an accessor within the data.
struct Rows<'a> {
    data: &'a [u8],
    component: u64,
    count: usize,
    stride: usize,
    size: usize,
}

impl<'a> Rows<'a> {
    fn iter(&self) -> impl Iterator<Item = &'a [u8]> {
        let (data, stride, size) = (self.data, self.stride, self.size);
        (0..self.count).map(move |i| &data[i * stride..i * stride + size])
    }
}

impl Document<'_> {
    /// A list of float vectors.
    pub(super) fn vectors(&self, accessor: usize, what: &str) -> Answer<Vec<Vec3>> {
        let rows = self.rows(accessor, "VEC3", 3)?;
        if rows.component != FLOAT {
            return Err(format!(
                "{what} has component type {}, not float: save it without quantisation",
                rows.component
            ));
        }
        let number = |b: &[u8]| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        Ok(rows.iter().map(|b| Vec3::new(number(b), number(&b[4..]), number(&b[8..]))).collect())
    }

    /// A list of indices.
    pub(super) fn indices(&self, accessor: usize) -> Answer<Vec<f64>> {
        let rows = self.rows(accessor, "SCALAR", 1)?;
        let number = |b: &[u8]| match *b {
            [a] => a.into(),
            [a, b] => u16::from_le_bytes([a, b]).into(),
            [a, b, c, d] => u32::from_le_bytes([a, b, c, d]).into(),
            _ => f64::NAN,
        };
        Ok(rows.iter().map(number).collect())
    }

    fn rows(&self, index: usize, kind: &str, components: usize) -> Answer<Rows<'_>> {
        let accessor = entry(&self.json, "accessors", index)?;
        if accessor["type"] != kind || !accessor["sparse"].is_null() {
            return Err(format!("accessors[{index}] must be a plain (not sparse) {kind}"));
        }
        let component = whole(accessor, "componentType", None)? as u64;
        let size = match component {
            UNSIGNED_BYTE => 1,
            UNSIGNED_SHORT => 2,
            UNSIGNED_INT => 4,
            FLOAT if components > 1 => 4,
            _ => {
                return Err(format!("accessors[{index}] has the unfit component type {component}"));
            }
        } * components;
        let view = entry(&self.json, "bufferViews", whole(accessor, "bufferView", None)?)?;
        let buffer = entry(&self.json, "buffers", whole(view, "buffer", None)?)?;
        if !buffer["uri"].is_null() || view["buffer"] != 0 {
            return Err("its data lie in another file: save it as one self-contained .glb".into());
        }
        let count = whole(accessor, "count", None)?;
        let stride = whole(view, "byteStride", Some(size))?;
        let view_start = whole(view, "byteOffset", Some(0))?;
        let view_length = whole(view, "byteLength", None)?;
        let start = whole(accessor, "byteOffset", Some(0))?;
        let data = view_start
            .checked_add(view_length)
            .and_then(|end| self.data.get(view_start..end))
            .and_then(|view| view.get(start..));
        let needed = count.saturating_sub(1).checked_mul(stride).and_then(|n| n.checked_add(size));
        match (data, needed) {
            (Some(data), Some(needed))
                if stride >= size && (count == 0 || needed <= data.len()) =>
            {
                Ok(Rows { data, component, count, stride, size })
            }
            _ => Err(format!(
                "accessors[{index}] asks for {count} entries of {size} bytes, {stride} bytes apart, which the {} \
                 bytes of data do not hold: the file is truncated or damaged",
                self.data.len()
            )),
        }
    }
}
