//! The body of a binary PLY file.

use super::{NumberType, Ply, PlyElement, PropertyColumn, PropertyType};
use crate::{Error, Result};
use std::path::Path;

/// Reads all elements; the body starts at byte `at`.
pub(super) fn read(ply: &mut Ply, bytes: &[u8], at: usize, big: bool, path: &Path) -> Result<()> {
    let mut body = ByteReader { bytes, at, big };
    for element in &mut ply.elements {
        // Each row has at least its scalars and the counts of its lists.
        let min_bytes: usize = element.properties.iter().map(|p| min_row_bytes(p.kind)).sum();
        let needed = element.count.checked_mul(min_bytes);
        if needed.is_none_or(|needed| needed > body.remaining()) {
            return Err(Error::format(path, truncation_message(element, min_bytes, &body)));
        }
        if element.properties.iter().all(|p| matches!(p.kind, PropertyType::Scalar(_))) {
            read_scalars(element, &mut body, min_bytes);
        } else {
            read_rows(element, &mut body).map_err(|message| Error::format(path, message))?;
        }
    }
    Ok(())
}

/// Smallest number of bytes of a property in a row.
fn min_row_bytes(kind: PropertyType) -> usize {
    match kind {
        PropertyType::Scalar(number) => number.size(),
        PropertyType::List { count, .. } => count.size(),
    }
}

/// The message for a file that is too short for the rows of `element`.
fn truncation_message(element: &PlyElement, min_bytes: usize, body: &ByteReader) -> String {
    let (name, count) = (&element.name, element.count);
    format!(
        "the header promises {count} rows of element '{name}' with at least {min_bytes} bytes each from byte {} on, \
         but the file ends at byte {}, in {name} {}: it is truncated or the count is wrong",
        body.at,
        body.bytes.len(),
        body.remaining() / min_bytes.max(1)
    )
}

/// Reads numbers from the body one after the other.
struct ByteReader<'a> {
    bytes: &'a [u8],
    at: usize,
    big: bool,
}

impl ByteReader<'_> {
    fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn read_number(&mut self, number: NumberType) -> Option<f64> {
        let size = number.size();
        let value = decode_number(self.bytes.get(self.at..self.at + size)?, 0, number, self.big);
        self.at += size;
        Some(value)
    }
}

/// Copies N bytes and brings them into little-endian order.
fn copy_array<const N: usize>(row: &[u8], at: usize, big: bool) -> [u8; N] {
    let mut bytes = [0; N];
    bytes.copy_from_slice(&row[at..at + N]);
    if big {
        bytes.reverse();
    }
    bytes
}

/// Decodes the number at byte `at`.
fn decode_number(row: &[u8], at: usize, number: NumberType, big: bool) -> f64 {
    match number {
        NumberType::I8 => i8::from_le_bytes(copy_array(row, at, big)).into(),
        NumberType::U8 => u8::from_le_bytes(copy_array(row, at, big)).into(),
        NumberType::I16 => i16::from_le_bytes(copy_array(row, at, big)).into(),
        NumberType::U16 => u16::from_le_bytes(copy_array(row, at, big)).into(),
        NumberType::I32 => i32::from_le_bytes(copy_array(row, at, big)).into(),
        NumberType::U32 => u32::from_le_bytes(copy_array(row, at, big)).into(),
        NumberType::F32 => f32::from_le_bytes(copy_array(row, at, big)).into(),
        NumberType::F64 => f64::from_le_bytes(copy_array(row, at, big)),
    }
}

/// Reads an element without lists, whose rows have the same size; each wanted column is decoded by
/// itself.
fn read_scalars(element: &mut PlyElement, body: &mut ByteReader, stride: usize) {
    let (big, length) = (body.big, element.count * stride);
    let block = &body.bytes[body.at..body.at + length];
    body.at += length;
    let mut at = 0;
    for property in &mut element.properties {
        let PropertyType::Scalar(number) = property.kind else { continue };
        let rows = block.chunks_exact(stride);
        if property.column.is_some() {
            property.column = Some(match number {
                NumberType::F32 => PropertyColumn::F32(
                    rows.map(|r| f32::from_le_bytes(copy_array(r, at, big))).collect(),
                ),
                _ => PropertyColumn::F64(rows.map(|r| decode_number(r, at, number, big)).collect()),
            });
        }
        at += number.size();
    }
}

/// The message for a file that ends within a row.
fn end_message(body: &ByteReader, name: &str, index: usize, count: usize) -> String {
    format!(
        "the file ends at byte {}, in {name} {index} of {count} (counted from 0): it is truncated",
        body.bytes.len()
    )
}

/// Reads an element with lists row by row.
fn read_rows(element: &mut PlyElement, body: &mut ByteReader) -> std::result::Result<(), String> {
    let (count, name) = (element.count, element.name.clone());
    let mut row = Vec::new();
    for index in 0..count {
        for property in &mut element.properties {
            row.clear();
            match property.kind {
                PropertyType::Scalar(number) => {
                    row.push(
                        body.read_number(number)
                            .ok_or_else(|| end_message(body, &name, index, count))?,
                    );
                }
                PropertyType::List { count: count_type, item } => {
                    let start = body.at;
                    let length = body
                        .read_number(count_type)
                        .ok_or_else(|| end_message(body, &name, index, count))?;
                    if length < 0.0 || length * item.size() as f64 > body.remaining() as f64 {
                        return Err(format!(
                            "byte {start} ({name} {index} of {count}): list '{}' has the count {length}, but {} bytes \
                             follow: the file is truncated or damaged",
                            property.name,
                            body.remaining()
                        ));
                    }
                    for _ in 0..length as usize {
                        row.push(
                            body.read_number(item)
                                .ok_or_else(|| end_message(body, &name, index, count))?,
                        );
                    }
                }
            }
            if let Some(column) = &mut property.column {
                column.push_row(&row);
            }
        }
    }
    Ok(())
}
