//! Types as a .msg file writes them: `float64`, `string<=10[<=3]`, `geometry_msgs/Pose[]`.

use crate::model::{Base, Count, FieldType, MessageName, Primitive};

/// Reads a type; `package` is that of the file, to which names without a package belong.
pub(crate) fn read(text: &str, package: &str) -> Result<FieldType, String> {
    let (element, count) = split_count(text)?;
    Ok(FieldType { base: base(element, package)?, count, written: text.to_string() })
}

/// Takes `[]`, `[3]` or `[<=3]` off the end.
fn split_count(text: &str) -> Result<(&str, Count), String> {
    let Some(open) = text.find('[') else {
        return Ok((text, Count::One));
    };
    let inside = text[open + 1..]
        .strip_suffix(']')
        .ok_or_else(|| format!("the type {text} has a [ but does not end with ]"))?;
    let count = match (inside, inside.strip_prefix("<=")) {
        ("", _) => Count::Sequence { bound: None },
        (_, Some(bound)) => Count::Sequence { bound: Some(positive(bound, text)?) },
        (fixed, None) => Count::Fixed(positive(fixed, text)?),
    };
    Ok((&text[..open], count))
}

fn positive(digits: &str, text: &str) -> Result<usize, String> {
    let number =
        digits.parse().ok().filter(|n| *n > 0 && digits.bytes().all(|b| b.is_ascii_digit()));
    number.ok_or_else(|| {
        format!("the type {text} needs a whole number above 0 in place of \"{digits}\"")
    })
}

fn base(text: &str, package: &str) -> Result<Base, String> {
    if let Some(primitive) = Primitive::from_ros(text) {
        return Ok(Base::Primitive(primitive));
    }
    if text == "string" {
        return Ok(Base::Text { bound: None });
    }
    if let Some(bound) = text.strip_prefix("string<=") {
        return Ok(Base::Text { bound: Some(positive(bound, text)?) });
    }
    let advice = match text {
        "time" | "duration" => Some("use builtin_interfaces/Time or builtin_interfaces/Duration"),
        "octet" => Some("use byte"),
        "float" | "double" => Some("use float32 or float64"),
        "int" | "long" | "short" | "unsigned" => Some("use int32 or another type with its width"),
        _ if text.starts_with("wstring") => Some("wide strings are not supported: use string"),
        _ => None,
    };
    match advice {
        Some(advice) => Err(format!("there is no type {text}: {advice}")),
        None => message(text, package).map(Base::Message),
    }
}

fn message(text: &str, package: &str) -> Result<MessageName, String> {
    let parts: Vec<&str> = text.split('/').collect();
    let (package, name) = match parts[..] {
        [name] => (package, name),
        [package, name] | [package, "msg", name] => (package, name),
        _ => return Err(format!("{text} is no type: write package/Name")),
    };
    package_name(package)?;
    interface_name(name)?;
    Ok(MessageName { package: package.to_string(), name: name.to_string() })
}

/// Checks a package's name: lower case, digits, single underscores.
pub(crate) fn package_name(name: &str) -> Result<(), String> {
    if is_lower_name(name) {
        return Ok(());
    }
    Err(format!("\"{name}\" is no package name: use a-z, 0-9 and single _, a letter first"))
}

/// Checks the name of a message, service or action: CamelCase.
pub(crate) fn interface_name(name: &str) -> Result<(), String> {
    let camel = name.starts_with(|c: char| c.is_ascii_uppercase())
        && name.chars().all(|c| c.is_ascii_alphanumeric());
    if camel {
        return Ok(());
    }
    Err(format!(
        "\"{name}\" is neither a primitive type nor the name of an interface, which begins with a \
         capital letter and holds only letters and digits"
    ))
}

/// Checks a field's name.
pub(crate) fn field_name(name: &str) -> Result<(), String> {
    if is_lower_name(name) {
        return Ok(());
    }
    Err(format!("\"{name}\" is no field name: use a-z, 0-9 and single _, a letter first"))
}

/// Checks a constant's name.
pub(crate) fn constant_name(name: &str) -> Result<(), String> {
    if is_lower_name(&name.to_ascii_lowercase()) && !name.contains(|c: char| c.is_lowercase()) {
        return Ok(());
    }
    Err(format!("\"{name}\" is no constant's name: use A-Z, 0-9 and single _, a letter first"))
}

fn is_lower_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && !name.contains("__")
        && !name.ends_with('_')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_type_keeps_the_text_that_it_was_written_as() {
        let kind = read("string<=10[<=3]", "own").unwrap();
        assert_eq!(kind.base, Base::Text { bound: Some(10) });
        assert_eq!(kind.count, Count::Sequence { bound: Some(3) });
        assert_eq!(kind.written, "string<=10[<=3]");
    }

    #[test]
    fn a_message_without_a_package_is_of_the_package_of_the_file() {
        for (text, package) in [("Pose", "own"), ("far_msgs/Pose", "far_msgs")] {
            let name = MessageName { package: package.into(), name: "Pose".into() };
            assert_eq!(read(text, "own").unwrap().base, Base::Message(name));
        }
    }

    #[test]
    fn bounds_are_whole_numbers_above_zero() {
        for text in ["int8[0]", "int8[-1]", "int8[+1]", "int8[1.0]", "int8[<=]", "string<=0"] {
            assert!(read(text, "own").unwrap_err().contains("a whole number above 0"), "{text}");
        }
    }

    #[test]
    fn names_follow_the_rules_of_ros_2() {
        for (name, is_package, is_interface, is_constant) in [
            ("lamp_msgs", true, false, false),
            ("a1", true, false, false),
            ("1a", false, false, false),
            ("a__b", false, false, false),
            ("a_", false, false, false),
            ("Pose", false, true, false),
            ("Pose2D", false, true, false),
            ("Pose_2D", false, false, false),
            ("MAX", false, true, true),
            ("MAX_1", false, false, true),
            ("_MAX", false, false, false),
            ("", false, false, false),
        ] {
            assert_eq!(package_name(name).is_ok(), is_package, "{name}");
            assert_eq!(field_name(name).is_ok(), is_package, "{name}");
            assert_eq!(interface_name(name).is_ok(), is_interface, "{name}");
            assert_eq!(constant_name(name).is_ok(), is_constant, "{name}");
        }
    }
}
