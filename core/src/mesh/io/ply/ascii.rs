//! The body of an ASCII PLY file: one line for each row.

use super::{NumberType, Ply, PlyElement, PropertyColumn, PropertyType};
use crate::{Error, Result};
use std::path::Path;

/// Iterates over the lines that are not empty, with their numbers.
pub(super) struct NumberedLines<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Number of the line at `at`, from 1.
    line: usize,
    newline: u8,
}

impl<'a> NumberedLines<'a> {
    /// Iterates from byte `at` on, where the first line has the number `line`.
    pub(super) fn new(bytes: &'a [u8], at: usize, line: usize, newline: u8) -> NumberedLines<'a> {
        NumberedLines { bytes, at, line, newline }
    }

    fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }
}

impl<'a> Iterator for NumberedLines<'a> {
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

/// Longest part of a word that messages show.
const MAX_SHOWN_CHARS: usize = 30;

/// Reads all elements.
pub(super) fn read(ply: &mut Ply, mut lines: NumberedLines, path: &Path) -> Result<()> {
    for element in &mut ply.elements {
        // An element without properties has empty rows.
        if !element.properties.is_empty() {
            read_element(element, &mut lines, path)?;
        }
    }
    Ok(())
}

fn read_element(element: &mut PlyElement, lines: &mut NumberedLines, path: &Path) -> Result<()> {
    let (count, name) = (element.count, element.name.clone());
    // Each number takes a digit and a separator; the last one of the file needs no separator.
    let min_bytes = count.checked_mul(2 * element.properties.len());
    if min_bytes.is_none_or(|min_bytes| min_bytes > lines.remaining() + 1) {
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
            property.column = Some(PropertyColumn::with_capacity(property.kind, count));
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
    element: &mut PlyElement,
    text: &[u8],
    row: &mut Vec<f64>,
) -> std::result::Result<(), String> {
    let text = std::str::from_utf8(text).map_err(|_| "is not text; is the file binary?")?;
    let mut words = text.split_ascii_whitespace();
    for property in &mut element.properties {
        row.clear();
        match property.kind {
            PropertyType::Scalar(number) => {
                row.push(take_number(&mut words, number, &property.name)?)
            }
            PropertyType::List { count, item } => {
                let count = take_number(&mut words, count, &property.name)?;
                if count < 0.0 {
                    return Err(format!("list '{}' has the negative count {count}", property.name));
                }
                // The words of the line limit the row: a count that is too large runs out of them.
                for _ in 0..count as usize {
                    row.push(take_number(&mut words, item, &property.name)?);
                }
            }
        }
        if let Some(column) = &mut property.column {
            column.push_row(row);
        }
    }
    match words.next() {
        Some(word) => Err(format!("'{}' stands after the last property", clip_word(word))),
        None => Ok(()),
    }
}

/// The beginning of a word, for messages.
fn clip_word(word: &str) -> String {
    word.chars().take(MAX_SHOWN_CHARS).collect()
}

/// Parses the next word of a row.
fn take_number<'a>(
    words: &mut impl Iterator<Item = &'a str>,
    number: NumberType,
    property: &str,
) -> std::result::Result<f64, String> {
    let word = words
        .next()
        .ok_or_else(|| format!("ends before property '{property}': the line is too short"))?;
    read_number(word, number, property)
}

/// Parses a number and checks it against the range of its type.
fn read_number(word: &str, number: NumberType, property: &str) -> std::result::Result<f64, String> {
    let value = match number {
        // Parsed in the precision of the property, so that no value is rounded twice.
        NumberType::F32 => word.parse::<f32>().map(f64::from),
        _ => word.parse::<f64>(),
    };
    let value = value
        .ok()
        .or_else(|| parse_windows_nan(word))
        .ok_or_else(|| format!("'{}' is not a number (property '{property}')", clip_word(word)))?;
    match number.range() {
        Some((low, high)) if !(value.fract() == 0.0 && (low..=high).contains(&value)) => {
            Err(format!(
                "{value} of property '{property}' is not an integer from {low} to {high}, as its type asks"
            ))
        }
        _ => Ok(value),
    }
}

/// NaN in the spellings that Windows programs write; `None` for other words.
fn parse_windows_nan(word: &str) -> Option<f64> {
    let word = word.trim_start_matches('-').to_ascii_lowercase();
    (word.starts_with("nan(") || word.starts_with("1.#")).then_some(f64::NAN)
}
