//! The header of a PLY file.

use super::{Encoding, NumberType, Ply, PlyElement, PlyProperty, PropertyType};
use crate::{Error, Result};
use std::path::Path;

/// Longest part of a line that messages show.
const MAX_SHOWN_CHARS: usize = 60;

/// A parsed header and the place of the body.
pub(super) struct ParsedHeader {
    pub(super) ply: Ply,
    pub(super) encoding: Encoding,
    /// First byte of the body.
    pub(super) body: usize,
    /// Number of the body's first line, from 1.
    pub(super) line: usize,
    /// What ends a line: `\n` (a `\r` before it is dropped), or `\r` in files of old Macs.
    pub(super) newline: u8,
}

/// Reads the header; the columns are left empty.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<ParsedHeader> {
    if !bytes.starts_with(b"ply") || !matches!(bytes.get(3), None | Some(b'\r' | b'\n' | b' ')) {
        return Err(Error::format(path, "is not a PLY file: its first line must be 'ply'"));
    }
    let lone_return = bytes.get(3) == Some(&b'\r') && bytes.get(4) != Some(&b'\n');
    let newline = if lone_return { b'\r' } else { b'\n' };
    let mut ply = Ply { comments: Vec::new(), obj_info: Vec::new(), elements: Vec::new() };
    let (mut encoding, mut at, mut line) = (None, 0, 0);
    loop {
        line += 1;
        let Some(length) = bytes[at..].iter().position(|b| *b == newline) else {
            let message = format!(
                "the header ends at byte {} (line {line}) without 'end_header': the file is truncated",
                bytes.len()
            );
            return Err(Error::format(path, message));
        };
        let text = String::from_utf8_lossy(&bytes[at..at + length]);
        at += length + 1;
        if text.trim() == "end_header" {
            break;
        }
        let found = read_line(text.trim(), &mut ply).map_err(|message| {
            Error::format(path, format!("header line {line}, '{}': {message}", clip_line(&text)))
        })?;
        if let Some(found) = found {
            encoding = Some(found);
        }
    }
    let Some(encoding) = encoding else {
        let message = "the header has no 'format' line: it must say 'format ascii 1.0', \
                     'format binary_little_endian 1.0' or 'format binary_big_endian 1.0'";
        return Err(Error::format(path, message));
    };
    Ok(ParsedHeader { ply, encoding, body: at, line: line + 1, newline })
}

/// The beginning of a line, for messages.
fn clip_line(text: &str) -> String {
    text.trim().chars().take(MAX_SHOWN_CHARS).collect()
}

/// Adds a line to `ply`; returns the encoding if it is the format line.
fn read_line(text: &str, ply: &mut Ply) -> std::result::Result<Option<Encoding>, String> {
    let (keyword, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    let words: Vec<&str> = rest.split_whitespace().collect();
    match keyword {
        "ply" | "" => {}
        "comment" => ply.comments.push(rest.trim().to_owned()),
        "obj_info" => ply.obj_info.push(rest.trim().to_owned()),
        "format" => return parse_encoding(&words).map(Some),
        "element" => ply.elements.push(parse_element(&words)?),
        "property" => {
            let property = parse_property(&words)?;
            let element = ply.elements.last_mut().ok_or("a property needs an element before it")?;
            element.properties.push(property);
        }
        _ => {
            return Err("unknown word; a header line starts with format, element, property, \
                        comment, obj_info or end_header"
                .into());
        }
    }
    Ok(None)
}

fn parse_encoding(words: &[&str]) -> std::result::Result<Encoding, String> {
    match words.first() {
        Some(&"ascii") => Ok(Encoding::Ascii),
        Some(&"binary_little_endian") => Ok(Encoding::Little),
        Some(&"binary_big_endian") => Ok(Encoding::Big),
        _ => {
            Err("unknown format; known are ascii, binary_little_endian and binary_big_endian"
                .into())
        }
    }
}

fn parse_element(words: &[&str]) -> std::result::Result<PlyElement, String> {
    let [name, count] = words else {
        return Err("must be 'element NAME COUNT'".into());
    };
    let count = count.parse().map_err(|_| format!("'{count}' is not a count of rows"))?;
    Ok(PlyElement { name: (*name).to_owned(), count, properties: Vec::new() })
}

fn parse_number_type(word: &str) -> std::result::Result<NumberType, String> {
    NumberType::from_name(word).ok_or_else(|| {
        format!(
            "unknown type '{word}'; known are char, uchar, short, ushort, int, uint, float, double"
        )
    })
}

fn parse_property(words: &[&str]) -> std::result::Result<PlyProperty, String> {
    let (kind, name) = match words {
        ["list", count, item, name] => {
            let (count, item) = (parse_number_type(count)?, parse_number_type(item)?);
            if count.range().is_none() {
                return Err("the count of a list must have an integer type".into());
            }
            (PropertyType::List { count, item }, name)
        }
        [scalar, name] => (PropertyType::Scalar(parse_number_type(scalar)?), name),
        _ => {
            return Err(
                "must be 'property TYPE NAME' or 'property list COUNT_TYPE TYPE NAME'".into()
            );
        }
    };
    Ok(PlyProperty { name: (*name).to_owned(), kind, column: None })
}
