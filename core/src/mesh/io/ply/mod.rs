//! PLY files (Turk 1994, The PLY Polygon File Format) with any elements and properties, read as
//! columns.

mod ascii;
mod binary;
mod cloud;
mod encoding;
mod header;
mod mesh;

pub(super) use cloud::{parse_cloud, write_cloud};
pub(crate) use encoding::{PlyHeader, push_floats};
pub(super) use mesh::{parse_mesh, write_mesh};

use crate::{Error, Result};
use std::path::Path;

/// A number type of the format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum NumberType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl NumberType {
    /// The type with this name in a header.
    fn from_name(word: &str) -> Option<NumberType> {
        Some(match word {
            "char" | "int8" => NumberType::I8,
            "uchar" | "uint8" => NumberType::U8,
            "short" | "int16" => NumberType::I16,
            "ushort" | "uint16" => NumberType::U16,
            "int" | "int32" => NumberType::I32,
            "uint" | "uint32" => NumberType::U32,
            "float" | "float32" => NumberType::F32,
            "double" | "float64" => NumberType::F64,
            _ => return None,
        })
    }

    /// Bytes of a number.
    fn size(self) -> usize {
        match self {
            NumberType::I8 | NumberType::U8 => 1,
            NumberType::I16 | NumberType::U16 => 2,
            NumberType::I32 | NumberType::U32 | NumberType::F32 => 4,
            NumberType::F64 => 8,
        }
    }

    /// Smallest and largest value of an integer type.
    fn range(self) -> Option<(f64, f64)> {
        Some(match self {
            NumberType::I8 => (i8::MIN.into(), i8::MAX.into()),
            NumberType::U8 => (0.0, u8::MAX.into()),
            NumberType::I16 => (i16::MIN.into(), i16::MAX.into()),
            NumberType::U16 => (0.0, u16::MAX.into()),
            NumberType::I32 => (i32::MIN.into(), i32::MAX.into()),
            NumberType::U32 => (0.0, u32::MAX.into()),
            NumberType::F32 | NumberType::F64 => return None,
        })
    }
}

/// The type of a property: one number in each row, or a list of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PropertyType {
    Scalar(NumberType),
    List { count: NumberType, item: NumberType },
}

/// The values of a property. Integers are held as `f64`, which holds each of them exactly.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum PropertyColumn {
    F32(Vec<f32>),
    F64(Vec<f64>),
    /// Row `i` is `values[starts[i]..starts[i + 1]]`.
    List {
        starts: Vec<usize>,
        values: Vec<f64>,
    },
}

impl PropertyColumn {
    fn with_capacity(kind: PropertyType, count: usize) -> PropertyColumn {
        match kind {
            PropertyType::Scalar(NumberType::F32) => PropertyColumn::F32(Vec::with_capacity(count)),
            PropertyType::Scalar(_) => PropertyColumn::F64(Vec::with_capacity(count)),
            PropertyType::List { .. } => {
                PropertyColumn::List { starts: vec![0], values: Vec::new() }
            }
        }
    }

    /// Appends one row (a scalar is a row of one).
    fn push_row(&mut self, row: &[f64]) {
        match self {
            PropertyColumn::F32(column) => column.extend(row.iter().map(|v| *v as f32)),
            PropertyColumn::F64(column) => column.extend_from_slice(row),
            PropertyColumn::List { starts, values } => {
                values.extend_from_slice(row);
                starts.push(values.len());
            }
        }
    }

    /// The scalar in row `index`; NaN for a list.
    pub(crate) fn scalar_at(&self, index: usize) -> f64 {
        match self {
            PropertyColumn::F32(column) => column[index].into(),
            PropertyColumn::F64(column) => column[index],
            PropertyColumn::List { .. } => f64::NAN,
        }
    }
}

/// One property, with its values if they were asked for.
#[derive(Debug)]
pub(crate) struct PlyProperty {
    pub(crate) name: String,
    pub(crate) kind: PropertyType,
    pub(crate) column: Option<PropertyColumn>,
}

/// One element: `count` rows of its properties.
#[derive(Debug)]
pub(crate) struct PlyElement {
    pub(crate) name: String,
    pub(crate) count: usize,
    pub(crate) properties: Vec<PlyProperty>,
}

impl PlyElement {
    /// The scalar column with one of `names`, if it was read.
    pub(crate) fn scalar_column(&self, names: &[&str]) -> Option<&PropertyColumn> {
        let mut scalars =
            self.properties.iter().filter(|p| matches!(p.kind, PropertyType::Scalar(_)));
        scalars.find(|p| names.contains(&p.name.as_str()))?.column.as_ref()
    }

    /// Three scalar columns, if all were read.
    pub(crate) fn vector_columns(&self, names: [&str; 3]) -> Option<[&PropertyColumn; 3]> {
        let [x, y, z] = names.map(|name| self.scalar_column(&[name]));
        Some([x?, y?, z?])
    }

    /// Starts and values of the list column with one of `names`, if it was read.
    pub(crate) fn list_column(&self, names: &[&str]) -> Option<(&[usize], &[f64])> {
        let found = self.properties.iter().filter(|p| names.contains(&p.name.as_str()));
        found.filter_map(|p| p.column.as_ref()).find_map(|column| match column {
            PropertyColumn::List { starts, values } => Some((starts.as_slice(), values.as_slice())),
            _ => None,
        })
    }
}

/// A PLY file: its comments and its elements.
#[derive(Debug)]
pub(crate) struct Ply {
    pub(crate) comments: Vec<String>,
    pub(crate) obj_info: Vec<String>,
    pub(crate) elements: Vec<PlyElement>,
}

impl Ply {
    /// The element of that name.
    pub(crate) fn element(&self, name: &str) -> Option<&PlyElement> {
        self.elements.iter().find(|e| e.name == name)
    }

    /// The element of that name, or an error that names the elements of the file.
    pub(crate) fn require_element(
        &self,
        path: &Path,
        name: &str,
        purpose: &str,
    ) -> Result<&PlyElement> {
        self.element(name).ok_or_else(|| {
            let has: Vec<_> = self.elements.iter().map(|e| e.name.as_str()).collect();
            Error::format(
                path,
                format!("has no element '{name}' (only: {}); {purpose}", has.join(", ")),
            )
        })
    }

    /// The integer after `key` in an `obj_info` or `comment` line.
    pub(crate) fn info_number(&self, key: &str) -> Option<usize> {
        self.obj_info.iter().chain(&self.comments).find_map(|line| {
            let mut words = line.split_whitespace();
            (words.next() == Some(key)).then(|| words.next()?.parse().ok()).flatten()
        })
    }
}

/// The encoding of the rows.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

/// Reads a PLY file and keeps the columns for which `wanted(element, property)` is true.
///
/// # Errors
/// [`Error::Format`] with the line or byte and the row if the file is malformed or ends early.
pub(crate) fn parse(bytes: &[u8], path: &Path, wanted: &dyn Fn(&str, &str) -> bool) -> Result<Ply> {
    let header = header::parse(bytes, path)?;
    let mut ply = header.ply;
    for element in &mut ply.elements {
        for property in &mut element.properties {
            if wanted(&element.name, &property.name) {
                // Memory is reserved later, when the number of rows is known to fit the file.
                property.column = Some(PropertyColumn::with_capacity(property.kind, 0));
            }
        }
    }
    match header.encoding {
        Encoding::Ascii => {
            let lines = ascii::NumberedLines::new(bytes, header.body, header.line, header.newline);
            ascii::read(&mut ply, lines, path)?;
        }
        encoding => binary::read(&mut ply, bytes, header.body, encoding == Encoding::Big, path)?,
    }
    Ok(ply)
}

#[cfg(test)]
mod tests;
