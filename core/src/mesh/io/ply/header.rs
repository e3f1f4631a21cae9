//! The header of a PLY file.

use super::{Element, Encoding, Kind, Number, Ply, Property};
use crate::{Error, Result};
use std::path::Path;

/// A header, and where the body starts.
pub(super) struct Header {
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
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Header> {
    let fail = |message: String| Err(Error::format(path, message));
    if !bytes.starts_with(b"ply") || !matches!(bytes.get(3), None | Some(b'\r' | b'\n' | b' ')) {
        return fail("is not a PLY file: its first line must be 'ply'".into());
    }
    let lone_return = bytes.get(3) == Some(&b'\r') && bytes.get(4) != Some(&b'\n');
    let newline = if lone_return { b'\r' } else { b'\n' };
    let mut ply = Ply { comments: Vec::new(), obj_info: Vec::new(), elements: Vec::new() };
    let (mut encoding, mut at, mut line) = (None, 0, 0);
    loop {
        line += 1;
        let Some(length) = bytes[at..].iter().position(|b| *b == newline) else {
            return fail(format!(
                "the header ends at byte {} (line {line}) without 'end_header': the file is truncated",
                bytes.len()
            ));
        };
        let text = String::from_utf8_lossy(&bytes[at..at + length]);
        at += length + 1;
        if text.trim() == "end_header" {
            break;
        }
        let found = read_line(text.trim(), &mut ply).map_err(|message| {
            Error::format(path, format!("header line {line}, '{}': {message}", clip(&text)))
        })?;
        if let Some(found) = found {
            encoding = Some(found);
        }
    }
    let Some(encoding) = encoding else {
        return fail(
            "the header has no 'format' line: it must say 'format ascii 1.0', \
                     'format binary_little_endian 1.0' or 'format binary_big_endian 1.0'"
                .into(),
        );
    };
    Ok(Header { ply, encoding, body: at, line: line + 1, newline })
}

fn clip(text: &str) -> String {
    text.trim().chars().take(60).collect()
}

/// Takes one line into `ply`; gives the encoding if it is the format line.
fn read_line(text: &str, ply: &mut Ply) -> std::result::Result<Option<Encoding>, String> {
    let (keyword, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    let words: Vec<&str> = rest.split_whitespace().collect();
    match keyword {
        "ply" | "" => {}
        "comment" => ply.comments.push(rest.trim().to_owned()),
        "obj_info" => ply.obj_info.push(rest.trim().to_owned()),
        "format" => return encoding(&words).map(Some),
        "element" => ply.elements.push(element(&words)?),
        "property" => {
            let property = property(&words)?;
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

fn encoding(words: &[&str]) -> std::result::Result<Encoding, String> {
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

fn element(words: &[&str]) -> std::result::Result<Element, String> {
    let [name, count] = words else {
        return Err("must be 'element NAME COUNT'".into());
    };
    let count = count.parse().map_err(|_| format!("'{count}' is not a count of rows"))?;
    Ok(Element { name: (*name).to_owned(), count, properties: Vec::new() })
}

fn property(words: &[&str]) -> std::result::Result<Property, String> {
    let number = |word: &str| {
        Number::named(word).ok_or_else(|| {
            format!(
                "unknown type '{word}'; known are char, uchar, short, ushort, int, uint, float, double"
            )
        })
    };
    let (kind, name) = match words {
        ["list", count, item, name] => {
            let (count, item) = (number(count)?, number(item)?);
            if count.range().is_none() {
                return Err("the count of a list must have an integer type".into());
            }
            (Kind::List { count, item }, name)
        }
        [scalar, name] => (Kind::Scalar(number(scalar)?), name),
        _ => {
            return Err(
                "must be 'property TYPE NAME' or 'property list COUNT_TYPE TYPE NAME'".into()
            );
        }
    };
    Ok(Property { name: (*name).to_owned(), kind, column: None })
}
