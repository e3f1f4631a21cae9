//! The text of one file.
//!
//! Comments become documentation. Lines above a field or constant describe it, and so does a
//! comment behind it. The first line of the comment at the top of a file describes the interface,
//! and so does the whole of that comment if a blank line follows it.

use crate::interface_error::{Error, Result};
use crate::model::{Constant, Count, Field, Kind, Part};
use crate::{type_syntax, value_syntax};
use std::path::Path;

/// Reads the parts of a file's text. `package` is the one that names without a package belong to.
pub(crate) fn read(text: &str, kind: Kind, package: &str, path: &Path) -> Result<Vec<Part>> {
    let mut parts = vec![Vec::new()];
    for (at, line) in text.lines().enumerate() {
        if line.trim() == "---" {
            parts.push(Vec::new());
        } else if let Some(part) = parts.last_mut() {
            part.push((at + 1, line.trim()));
        }
    }
    if parts.len() != kind.parts() {
        let (found, wanted) = (parts.len() - 1, kind.parts() - 1);
        let message = format!("a .{} file has {wanted} lines ---, not {found}", kind.name());
        return Err(Error::file(path, message));
    }
    parts.iter().enumerate().map(|(at, lines)| part(lines, at == 0, package, path)).collect()
}

fn part(lines: &[(usize, &str)], is_first: bool, package: &str, path: &Path) -> Result<Part> {
    let mut part = Part { text: text_of(lines), ..Part::default() };
    let mut above: Vec<String> = Vec::new();
    // Whether we are still in the comment at the top.
    let mut at_top = is_first;
    for (number, line) in lines {
        if let Some(comment) = line.strip_prefix('#') {
            let comment = comment.trim_start_matches('#').trim().to_string();
            if at_top && part.docs.is_empty() {
                part.docs.push(comment);
            } else {
                above.push(comment);
            }
            continue;
        }
        if line.is_empty() {
            if at_top && !part.docs.is_empty() {
                part.docs.append(&mut above);
                at_top = false;
            }
            above.clear();
            continue;
        }
        at_top = false;
        entry(line, *number, std::mem::take(&mut above), package, &mut part)
            .map_err(|message| Error::line(path, *number, message))?;
    }
    Ok(part)
}

/// The text without blank lines at both ends.
fn text_of(lines: &[(usize, &str)]) -> String {
    let text = lines.iter().map(|(_, line)| *line).collect::<Vec<_>>().join("\n");
    text.trim().to_string()
}

/// One field or constant.
fn entry(
    line: &str,
    number: usize,
    mut docs: Vec<String>,
    package: &str,
    part: &mut Part,
) -> std::result::Result<(), String> {
    let (kind, rest) = line
        .split_once(char::is_whitespace)
        .ok_or_else(|| format!("\"{line}\" is no field: write a type, a space and a name"))?;
    let kind = type_syntax::read(kind, package)?;
    let rest = rest.trim_start();
    let end = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len());
    let (name, rest) = (rest[..end].to_string(), rest[end..].trim_start());
    let taken = part.fields.iter().any(|f| f.name == name)
        || part.constants.iter().any(|constant| constant.name == name);
    if taken {
        return Err(format!("the name {name} is used twice"));
    }
    if let Some(value) = rest.strip_prefix('=') {
        type_syntax::constant_name(&name)?;
        if kind.count != Count::One {
            return Err(format!("the constant {name} cannot be an array"));
        }
        let (value, rest) = value_syntax::read(value, &kind)?;
        docs.extend(comment(rest)?);
        part.constants.push(Constant { name, kind, value, docs });
        return Ok(());
    }
    type_syntax::field_name(&name)?;
    let (default, rest) = if rest.is_empty() || rest.starts_with('#') {
        (None, rest)
    } else {
        let (value, rest) = value_syntax::read(rest, &kind)?;
        (Some(value), rest)
    };
    docs.extend(comment(rest)?);
    part.fields.push(Field { name, kind, default, docs, line: number });
    Ok(())
}

/// What stands behind an entry: nothing, or a comment.
fn comment(rest: &str) -> std::result::Result<Option<String>, String> {
    let rest = rest.trim();
    match rest.strip_prefix('#') {
        Some(comment) => Ok(Some(comment.trim().to_string()).filter(|text| !text.is_empty())),
        None if rest.is_empty() => Ok(None),
        None => Err(format!("\"{rest}\" is left over: put a # before a comment")),
    }
}
