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
    if primitive == Primitive::Bool {
        return match word.to_ascii_lowercase().as_str() {
            "true" | "1" => Ok(Value::Bool(true)),
            "false" | "0" => Ok(Value::Bool(false)),
            _ => Err(format!("\"{word}\" is no bool: write true or false")),
        };
    }
    if primitive.is_float() {
        let value: f64 = word.parse().map_err(|_| type_error(word, primitive))?;
        return Ok(Value::Float(value));
    }
    let value: i128 = word.parse().map_err(|_| type_error(word, primitive))?;
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

fn type_error(word: &str, primitive: Primitive) -> String {
    format!("\"{word}\" is no value of type {}", primitive.rust())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::type_syntax;

    fn value(text: &str, kind: &str) -> Result<(Value, String), String> {
        let kind = type_syntax::read(kind, "own")?;
        read(text, &kind).map(|(value, rest)| (value, rest.to_owned()))
    }

    #[test]
    fn integers_end_at_the_limits_of_their_types() {
        for (kind, low, high) in [
            ("int8", "-128", "127"),
            ("byte", "0", "255"),
            ("uint16", "0", "65535"),
            ("int32", "-2147483648", "2147483647"),
            ("int64", "-9223372036854775808", "9223372036854775807"),
            ("uint64", "0", "18446744073709551615"),
        ] {
            for limit in [low, high] {
                let number: i128 = limit.parse().unwrap();
                assert_eq!(value(limit, kind).unwrap().0, Value::Integer(number), "{kind}");
                let beyond = if limit == low { number - 1 } else { number + 1 };
                let error = value(&beyond.to_string(), kind).unwrap_err();
                assert!(error.contains(&format!("{low} to {high}")), "{error}");
            }
        }
    }

    #[test]
    fn what_follows_a_value_is_returned() {
        let (found, rest) = value("1.5e3 # metres", "float64").unwrap();
        assert_eq!((found, &*rest), (Value::Float(1500.0), "# metres"));
        let (found, rest) = value("[1, 2,] # both", "int8[]").unwrap();
        let both = Value::List(vec![Value::Integer(1), Value::Integer(2)]);
        assert_eq!((found, &*rest), (both, " # both"));
        let (found, rest) = value("'a # b' # c", "string").unwrap();
        assert_eq!((found, &*rest), (Value::Text("a # b".into()), " # c"));
    }

    #[test]
    fn flags_are_words_or_digits() {
        for (text, flag) in [("true", true), ("True", true), ("1", true), ("FALSE", false)] {
            assert_eq!(value(text, "bool").unwrap().0, Value::Bool(flag));
        }
        assert!(value("2", "bool").is_err());
    }
}
