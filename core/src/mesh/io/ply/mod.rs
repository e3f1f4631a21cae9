//! PLY files (Turk 1994, The PLY Polygon File Format): any elements and properties, as columns.

mod ascii;
mod binary;
mod cloud;
mod encode;
mod header;
mod mesh;

pub(super) use cloud::{parse_cloud, write_cloud};
pub(crate) use encode::{Layout, push_floats};
pub(super) use mesh::{parse_mesh, write_mesh};

use crate::{Error, Result};
use std::path::Path;

/// A number type of the format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    fn named(word: &str) -> Option<Number> {
        Some(match word {
            "char" | "int8" => Number::I8,
            "uchar" | "uint8" => Number::U8,
            "short" | "int16" => Number::I16,
            "ushort" | "uint16" => Number::U16,
            "int" | "int32" => Number::I32,
            "uint" | "uint32" => Number::U32,
            "float" | "float32" => Number::F32,
            "double" | "float64" => Number::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Number::I8 | Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::I32 | Number::U32 | Number::F32 => 4,
            Number::F64 => 8,
        }
    }

    /// Smallest and largest value of an integer type.
    fn range(self) -> Option<(f64, f64)> {
        Some(match self {
            Number::I8 => (i8::MIN.into(), i8::MAX.into()),
            Number::U8 => (0.0, u8::MAX.into()),
            Number::I16 => (i16::MIN.into(), i16::MAX.into()),
            Number::U16 => (0.0, u16::MAX.into()),
            Number::I32 => (i32::MIN.into(), i32::MAX.into()),
            Number::U32 => (0.0, u32::MAX.into()),
            Number::F32 | Number::F64 => return None,
        })
    }
}

/// What stands in each row of a property.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    Scalar(Number),
    List { count: Number, item: Number },
}

/// The values of a property. Integers are held as `f64`, which holds each of them exactly.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Column {
    F32(Vec<f32>),
    F64(Vec<f64>),
    /// Row `i` is `values[starts[i]..starts[i + 1]]`.
    List {
        starts: Vec<usize>,
        values: Vec<f64>,
    },
}

impl Column {
    fn with_capacity(kind: Kind, count: usize) -> Column {
        match kind {
            Kind::Scalar(Number::F32) => Column::F32(Vec::with_capacity(count)),
            Kind::Scalar(_) => Column::F64(Vec::with_capacity(count)),
            Kind::List { .. } => Column::List { starts: vec![0], values: Vec::new() },
        }
    }

    /// Appends one row (a scalar is a row of one).
    fn push_row(&mut self, row: &[f64]) {
        match self {
            Column::F32(column) => column.extend(row.iter().map(|v| *v as f32)),
            Column::F64(column) => column.extend_from_slice(row),
            Column::List { starts, values } => {
                values.extend_from_slice(row);
                starts.push(values.len());
            }
        }
    }

    /// The scalar in row `index`; NaN for a list.
    pub(crate) fn get(&self, index: usize) -> f64 {
        match self {
            Column::F32(column) => column[index].into(),
            Column::F64(column) => column[index],
            Column::List { .. } => f64::NAN,
        }
    }
}

/// One property, with its values if they were asked for.
#[derive(Debug)]
pub(crate) struct Property {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) column: Option<Column>,
}

/// One element: `count` rows of its properties.
#[derive(Debug)]
pub(crate) struct Element {
    pub(crate) name: String,
    pub(crate) count: usize,
    pub(crate) properties: Vec<Property>,
}

impl Element {
    /// The scalar column that bears one of `names`.
    pub(crate) fn scalar(&self, names: &[&str]) -> Option<&Column> {
        let named = |p: &&Property| names.contains(&p.name.as_str());
        let scalar = |p: &&Property| matches!(p.kind, Kind::Scalar(_));
        self.properties.iter().filter(scalar).find(named)?.column.as_ref()
    }

    /// Three scalar columns, if all are there.
    pub(crate) fn triple(&self, names: [&str; 3]) -> Option<[&Column; 3]> {
        let [x, y, z] = names.map(|name| self.scalar(&[name]));
        Some([x?, y?, z?])
    }

    /// The list column that bears one of `names`: starts and values.
    pub(crate) fn list(&self, names: &[&str]) -> Option<(&[usize], &[f64])> {
        let found = self.properties.iter().filter(|p| names.contains(&p.name.as_str()));
        found.filter_map(|p| p.column.as_ref()).find_map(|column| match column {
            Column::List { starts, values } => Some((starts.as_slice(), values.as_slice())),
            _ => None,
        })
    }
}

/// A PLY file: its remarks and its elements.
#[derive(Debug)]
pub(crate) struct Ply {
    #[allow(dead_code)]
    // Kept for whoever wants a file's origin; the readers here need obj_info only.
    pub(crate) comments: Vec<String>,
    pub(crate) obj_info: Vec<String>,
    pub(crate) elements: Vec<Element>,
}

impl Ply {
    /// The element of that name.
    pub(crate) fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }

    /// The element of that name, or an error that tells what the file has.
    pub(crate) fn require(&self, path: &Path, name: &str, purpose: &str) -> Result<&Element> {
        self.element(name).ok_or_else(|| {
            let has: Vec<_> = self.elements.iter().map(|e| e.name.as_str()).collect();
            Error::format(
                path,
                format!("has no element '{name}' (only: {}); {purpose}", has.join(", ")),
            )
        })
    }

    /// The whole number after `key` in an `obj_info` or `comment` line.
    pub(crate) fn info_number(&self, key: &str) -> Option<usize> {
        self.obj_info.iter().chain(&self.comments).find_map(|line| {
            let mut words = line.split_whitespace();
            (words.next() == Some(key)).then(|| words.next()?.parse().ok()).flatten()
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

/// Reads a PLY file, keeping the columns for which `wanted(element, property)` holds.
///
/// # Errors
/// [`Error::Format`] with the line or byte and the element's number if the file is malformed or ends early.
pub(crate) fn parse(bytes: &[u8], path: &Path, wanted: &dyn Fn(&str, &str) -> bool) -> Result<Ply> {
    let header = header::parse(bytes, path)?;
    let mut ply = header.ply;
    for element in &mut ply.elements {
        for property in &mut element.properties {
            if wanted(&element.name, &property.name) {
                // The room for its rows is taken once their number is known to fit the file.
                property.column = Some(Column::with_capacity(property.kind, 0));
            }
        }
    }
    match header.encoding {
        Encoding::Ascii => {
            let lines = ascii::Lines::new(bytes, header.body, header.line, header.newline);
            ascii::read(&mut ply, lines, path)?;
        }
        encoding => binary::read(&mut ply, bytes, header.body, encoding == Encoding::Big, path)?,
    }
    Ok(ply)
}

#[cfg(test)]
mod tests;
