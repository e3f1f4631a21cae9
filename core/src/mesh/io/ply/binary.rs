//! The body of a binary PLY file.

use super::{Column, Element, Kind, Number, Ply};
use crate::{Error, Result};
use std::path::Path;

/// Reads all elements; the body starts at byte `at`.
pub(super) fn read(ply: &mut Ply, bytes: &[u8], at: usize, big: bool, path: &Path) -> Result<()> {
    let mut body = Body { bytes, at, big };
    for element in &mut ply.elements {
        // The list counts at least must be there, whatever the lists hold.
        let least: usize = element.properties.iter().map(|p| least_size(p.kind)).sum();
        let needed = element.count.checked_mul(least);
        if needed.is_none_or(|needed| needed > body.remaining()) {
            return Err(Error::format(path, promise(element, least, &body)));
        }
        if element.properties.iter().all(|p| matches!(p.kind, Kind::Scalar(_))) {
            read_scalars(element, &mut body, least);
        } else {
            read_rows(element, &mut body).map_err(|message| Error::format(path, message))?;
        }
    }
    Ok(())
}

fn least_size(kind: Kind) -> usize {
    match kind {
        Kind::Scalar(number) => number.size(),
        Kind::List { count, .. } => count.size(),
    }
}

fn promise(element: &Element, least: usize, body: &Body) -> String {
    let (name, count) = (&element.name, element.count);
    format!(
        "the header promises {count} rows of element '{name}' with at least {least} bytes each from byte {} on, \
         but the file ends at byte {}, in {name} {}: it is truncated or the count is wrong",
        body.at,
        body.bytes.len(),
        body.remaining() / least.max(1)
    )
}

struct Body<'a> {
    bytes: &'a [u8],
    at: usize,
    big: bool,
}

impl Body<'_> {
    fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn take(&mut self, number: Number) -> Option<f64> {
        let size = number.size();
        let value = value(self.bytes.get(self.at..self.at + size)?, 0, number, self.big);
        self.at += size;
        Some(value)
    }
}

fn fixed<const N: usize>(row: &[u8], at: usize, big: bool) -> [u8; N] {
    let mut bytes = [0; N];
    bytes.copy_from_slice(&row[at..at + N]);
    if big {
        bytes.reverse();
    }
    bytes
}

fn value(row: &[u8], at: usize, number: Number, big: bool) -> f64 {
    match number {
        Number::I8 => i8::from_le_bytes(fixed(row, at, big)).into(),
        Number::U8 => u8::from_le_bytes(fixed(row, at, big)).into(),
        Number::I16 => i16::from_le_bytes(fixed(row, at, big)).into(),
        Number::U16 => u16::from_le_bytes(fixed(row, at, big)).into(),
        Number::I32 => i32::from_le_bytes(fixed(row, at, big)).into(),
        Number::U32 => u32::from_le_bytes(fixed(row, at, big)).into(),
        Number::F32 => f32::from_le_bytes(fixed(row, at, big)).into(),
        Number::F64 => f64::from_le_bytes(fixed(row, at, big)),
    }
}

/// Rows of one size: each wanted column is decoded on its own.
fn read_scalars(element: &mut Element, body: &mut Body, stride: usize) {
    let (big, length) = (body.big, element.count * stride);
    let block = &body.bytes[body.at..body.at + length];
    body.at += length;
    let mut at = 0;
    for property in &mut element.properties {
        let Kind::Scalar(number) = property.kind else { continue };
        let rows = || block.chunks_exact(stride);
        if property.column.is_some() {
            property.column = Some(match number {
                Number::F32 => {
                    Column::F32(rows().map(|r| f32::from_le_bytes(fixed(r, at, big))).collect())
                }
                _ => Column::F64(rows().map(|r| value(r, at, number, big)).collect()),
            });
        }
        at += number.size();
    }
}

fn read_rows(element: &mut Element, body: &mut Body) -> std::result::Result<(), String> {
    let (count, name) = (element.count, element.name.clone());
    let mut row = Vec::new();
    for index in 0..count {
        let ends = |bytes: &[u8]| {
            format!(
                "the file ends at byte {}, in {name} {index} of {count} (counted from 0): it is truncated",
                bytes.len()
            )
        };
        for property in &mut element.properties {
            row.clear();
            match property.kind {
                Kind::Scalar(number) => {
                    row.push(body.take(number).ok_or_else(|| ends(body.bytes))?);
                }
                Kind::List { count: count_type, item } => {
                    let start = body.at;
                    let length = body.take(count_type).ok_or_else(|| ends(body.bytes))?;
                    if length < 0.0 || length * item.size() as f64 > body.remaining() as f64 {
                        return Err(format!(
                            "byte {start} ({name} {index} of {count}): list '{}' has the count {length}, but {} bytes \
                             follow: the file is truncated or damaged",
                            property.name,
                            body.remaining()
                        ));
                    }
                    for _ in 0..length as usize {
                        row.push(body.take(item).ok_or_else(|| ends(body.bytes))?);
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
