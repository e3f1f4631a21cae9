//! Values of constants and defaults: numbers, words, quoted strings, lists.

use crate::model::{Base, Count, FieldType, Primitive, Value};

/// Reads a value of the type from the beginning of `text`; gives what follows it, too.
pub(crate) fn read<'a>(text: &'a str, kind: &FieldType) -> Result<(Value, &'a str), String> {
    match kind.count {
        Count::One => element(text.trim_start(), kind, "#"),
        Count::Fixed(_) | Count::Sequence { .. } => list(text.trim_start(), kind),
    }
}

fn list<'a>(text: &'a str, kind: &FieldType) -> Result<(Value, &'a str), String> {
    let mut rest = text
        .strip_prefix('[')
        .ok_or_else(|| format!("a value of {} is a list: [a, b]", kind.written))?
        .trim_start();
    let mut values = Vec::new();
    while !rest.starts_with(']') {
        let (value, after) = element(rest, kind, ",]#")?;
        values.push(value);
        rest = after.trim_start();
        match rest.strip_prefix(',') {
            Some(after) => rest = after.trim_start(),
            None if rest.starts_with(']') => {}
            None => return Err(format!("the list {text} does not end with ]")),
        }
    }
    let fits = match kind.count {
        Count::Fixed(n) => values.len() == n,
        Count::Sequence { bound: Some(n) } => values.len() <= n,
        Count::Sequence { bound: None } | Count::One => true,
    };
    if !fits {
        return Err(format!("a list of {} values does not fit {}", values.len(), kind.written));
    }
    Ok((Value::List(values), &rest[1..]))
}

/// One value; without quotes it ends before any of the signs in `ends`.
fn element<'a>(text: &'a str, kind: &FieldType, ends: &str) -> Result<(Value, &'a str), String> {
    let quoted = text.starts_with(['"', '\'']);
    let (word, rest) = match (&kind.base, quoted) {
        (Base::Text { .. }, true) => quoted_text(text)?,
        _ => {
            let end = text.find(|c| ends.contains(c)).unwrap_or(text.len());
            (text[..end].trim_end().to_string(), &text[end..])
        }
    };
    let value = match &kind.base {
        Base::Primitive(primitive) => number(&word, *primitive),
        Base::Text { bound } => match bound {
            Some(bound) if word.len() > *bound => {
                Err(format!("\"{word}\" is longer than the {bound} bytes of {}", kind.written))
            }
            _ => Ok(Value::Text(word)),
        },
        Base::Message(_) => Err(format!("{} cannot have a value of its own", kind.written)),
    };
    Ok((value?, rest))
}

/// The text between two quotes, in which a backslash keeps the next sign.
fn quoted_text(text: &str) -> Result<(String, &str), String> {
    let mut signs = text.char_indices();
    let quote = signs.next().map(|(_, sign)| sign);
    let mut out = String::new();
    while let Some((at, sign)) = signs.next() {
        if Some(sign) == quote {
            return Ok((out, &text[at + sign.len_utf8()..]));
        }
        match (sign, sign == '\\') {
            (_, true) => match signs.next() {
                Some((_, 'n')) => out.push('\n'),
                Some((_, 't')) => out.push('\t'),
                Some((_, kept)) => out.push(kept),
                None => break,
            },
            (_, false) => out.push(sign),
        }
    }
    Err(format!("the string {text} has no closing quote"))
}

fn number(word: &str, primitive: Primitive) -> Result<Value, String> {
    let wrong = || format!("\"{word}\" is no value of type {}", primitive.rust());
    if primitive == Primitive::Bool {
        return match word.to_ascii_lowercase().as_str() {
            "true" | "1" => Ok(Value::Bool(true)),
            "false" | "0" => Ok(Value::Bool(false)),
            _ => Err(format!("\"{word}\" is no bool: write true or false")),
        };
    }
    if primitive.is_float() {
        let value: f64 = word.parse().map_err(|_| wrong())?;
        return Ok(Value::Float(value));
    }
    let value: i128 = word.parse().map_err(|_| wrong())?;
    let bits = 8 * primitive.size() as u32;
    let (low, high) = if primitive.rust().starts_with('i') {
        (-(1i128 << (bits - 1)), (1i128 << (bits - 1)) - 1)
    } else {
        (0, (1i128 << bits) - 1)
    };
    if !(low..=high).contains(&value) {
        return Err(format!("{value} does not fit {}: {low} to {high}", primitive.rust()));
    }
    Ok(Value::Integer(value))
}
