//! The body of an ASCII PLY file: a line a row.

use super::{Column, Element, Kind, Number, Ply};
use crate::{Error, Result};
use std::path::Path;

/// The lines that hold something, with their numbers.
pub(super) struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Number of the line at `at`, from 1.
    line: usize,
    newline: u8,
}

impl<'a> Lines<'a> {
    /// The lines from byte `at` on, of which the first has number `line`.
    pub(super) fn new(bytes: &'a [u8], at: usize, line: usize, newline: u8) -> Lines<'a> {
        Lines { bytes, at, line, newline }
    }

    fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<(usize, &'a [u8])> {
        loop {
            let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
            let length = rest.iter().position(|b| *b == self.newline).unwrap_or(rest.len());
            let text = rest[..length].trim_ascii();
            let number = self.line;
            self.at = (self.at + length + 1).min(self.bytes.len());
            self.line += 1;
            if !text.is_empty() {
                return Some((number, text));
            }
        }
    }
}

/// Reads all elements.
pub(super) fn read(ply: &mut Ply, mut lines: Lines, path: &Path) -> Result<()> {
    for element in &mut ply.elements {
        // An element without properties has empty rows.
        if !element.properties.is_empty() {
            read_element(element, &mut lines, path)?;
        }
    }
    Ok(())
}

fn read_element(element: &mut Element, lines: &mut Lines, path: &Path) -> Result<()> {
    let (count, name) = (element.count, element.name.clone());
    // Each number takes a digit and a separator; the last one of the file needs no separator.
    let least = count.checked_mul(2 * element.properties.len());
    if least.is_none_or(|least| least > lines.remaining() + 1) {
        return Err(Error::format(
            path,
            format!(
                "the header promises {count} rows of element '{name}', but only {} bytes follow from line {} on: \
                 the file is truncated or the count is wrong",
                lines.remaining(),
                lines.line
            ),
        ));
    }
    for property in &mut element.properties {
        if property.column.is_some() {
            property.column = Some(Column::with_capacity(property.kind, count));
        }
    }
    let mut row = Vec::new();
    for index in 0..count {
        let (line, text) = lines.next().ok_or_else(|| {
            Error::format(
                path,
                format!(
                    "the file ends at line {}, before {name} {index} of {count} (counted from 0): it is truncated",
                    lines.line
                ),
            )
        })?;
        read_row(element, text, &mut row).map_err(|message| {
            Error::format(path, format!("line {line} ({name} {index} of {count}): {message}"))
        })?;
    }
    Ok(())
}

fn read_row(
    element: &mut Element,
    text: &[u8],
    row: &mut Vec<f64>,
) -> std::result::Result<(), String> {
    let text = std::str::from_utf8(text).map_err(|_| "is not text; is the file binary?")?;
    let mut words = text.split_ascii_whitespace();
    for property in &mut element.properties {
        row.clear();
        let mut take = |number| {
            let word = words.next().ok_or_else(|| {
                format!("ends before property '{}': the line is too short", property.name)
            })?;
            read_number(word, number, &property.name)
        };
        match property.kind {
            Kind::Scalar(number) => row.push(take(number)?),
            Kind::List { count, item } => {
                let count = take(count)?;
                if count < 0.0 {
                    return Err(format!("list '{}' has the negative count {count}", property.name));
                }
                // The words themselves limit the rows: a count that is too large runs out of them.
                for _ in 0..count as usize {
                    row.push(take(item)?);
                }
            }
        }
        if let Some(column) = &mut property.column {
            column.push_row(row);
        }
    }
    match words.next() {
        Some(word) => Err(format!("'{}' stands after the last property", clip(word))),
        None => Ok(()),
    }
}

fn clip(word: &str) -> String {
    word.chars().take(30).collect()
}

fn read_number(word: &str, number: Number, property: &str) -> std::result::Result<f64, String> {
    let value = match number {
        // Read in the precision of the property, so that no value is rounded twice.
        Number::F32 => word.parse::<f32>().map(f64::from),
        _ => word.parse::<f64>(),
    };
    let value = value
        .ok()
        .or_else(|| foreign_nan(word))
        .ok_or_else(|| format!("'{}' is not a number (property '{property}')", clip(word)))?;
    match number.range() {
        Some((low, high)) if !(value.fract() == 0.0 && (low..=high).contains(&value)) => {
            Err(format!(
                "{value} of property '{property}' is not an integer from {low} to {high}, as its type asks"
            ))
        }
        _ => Ok(value),
    }
}

/// The spellings of NaN that Windows writes.
fn foreign_nan(word: &str) -> Option<f64> {
    let word = word.trim_start_matches('-').to_ascii_lowercase();
    (word.starts_with("nan(") || word.starts_with("1.#")).then_some(f64::NAN)
}
