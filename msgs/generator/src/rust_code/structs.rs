//! One Rust struct for a message or a part of a service or action.

use super::doc_comments;
use super::values::{default_of, rust_value};
use crate::interface_tree::InterfaceTree;
use crate::model::{Base, Count, Field, FieldType, Part, Primitive};
use crate::ros2msg_text;

/// Messages of at most this many octets that hold nothing on the heap are `Copy`: a pose is, a
/// covariance is not.
const MAX_COPY_BYTES: usize = 64;
/// Serde and `Default` know arrays of up to this length.
const MAX_DERIVED_ARRAY_LENGTH: usize = 32;

/// StructNames of one struct.
pub(super) struct StructNames<'a> {
    /// Package whose types stand at the root of the crate.
    pub own: &'a str,
    pub package: &'a str,
    /// `msg`, `srv` or `action`.
    pub kind: &'static str,
    /// `PlanView_Request`.
    pub ros: &'a str,
    /// `PlanViewRequest`.
    pub rust: &'a str,
    /// Documentation if the file has none.
    pub docs: &'a str,
}

/// Writes the struct, its constants, its default and its traits.
pub(super) fn write(out: &mut String, tree: &InterfaceTree, part: &Part, names: &StructNames) {
    let needs_default = part.fields.iter().any(|f| has_default(f) || is_long(&f.kind));
    doc_comments::write(out, "", &part.docs, names.docs);
    let mut derives =
        vec!["Clone", "Debug", "PartialEq", "::serde::Serialize", "::serde::Deserialize"];
    if !needs_default {
        derives.push("Default");
    }
    if !tree.has_float(part) {
        derives.extend(["Eq", "Hash"]);
    }
    if tree.fixed_size(part).is_some_and(|size| size <= MAX_COPY_BYTES) {
        derives.push("Copy");
    }
    out.push_str(&format!("#[derive({})]\npub struct {} {{\n", derives.join(", "), names.rust));
    for field in &part.fields {
        write_field(out, field, names.own);
    }
    if part.fields.is_empty() {
        out.push_str("    /// Always 0; ROS 2 sends an empty message as one octet.\n");
        out.push_str("    pub structure_needs_at_least_one_member: u8,\n");
    }
    out.push_str("}\n\n");
    write_constants(out, part, names.rust);
    if needs_default {
        write_default(out, part, names);
    }
    write_interface(out, names, &ros2msg_text::full_text(tree, part));
}

fn write_field(out: &mut String, field: &Field, own: &str) {
    let replacement = format!("`{} {}`", field.kind.written, field.name);
    doc_comments::write(out, "    ", &field.docs, &replacement);
    if let Some(attribute) = serde_attribute(&field.kind) {
        out.push_str(&format!("    #[serde({attribute})]\n"));
    }
    let name = field_name(&field.name);
    if name.ends_with('_') {
        out.push_str(&format!("    #[serde(rename = \"{}\")]\n", field.name));
    }
    out.push_str(&format!("    pub {name}: {},\n", rust_type(&field.kind, own)));
}

/// The serde attribute of a field: for octets in one piece, long arrays and bounds.
fn serde_attribute(kind: &FieldType) -> Option<String> {
    let is_octets = kind.base == Base::Primitive(Primitive::U8);
    match (&kind.base, kind.count) {
        (_, Count::Sequence { bound: None }) if is_octets => {
            Some("with = \"::serde_bytes\"".into())
        }
        (Base::Text { bound: Some(n) }, Count::One) => Some(format!(
            "serialize_with = \"crate::field_serde::serialize_text::<{n}, _>\", \
                     deserialize_with = \"crate::field_serde::deserialize_text::<{n}, _>\""
        )),
        (_, Count::Sequence { bound: Some(n) }) => Some(format!(
            "serialize_with = \"crate::field_serde::serialize_sequence::<{n}, _, _>\", \
             deserialize_with = \"crate::field_serde::deserialize_sequence::<{n}, _, _>\""
        )),
        _ if is_long(kind) => Some("with = \"crate::field_serde::array\"".into()),
        _ => None,
    }
}

/// Whether the file gives the field a value other than that of Rust's `Default`.
fn has_default(field: &Field) -> bool {
    field.default.as_ref().is_some_and(|value| !value.is_rust_default(field.kind.count))
}

fn is_long(kind: &FieldType) -> bool {
    matches!(kind.count, Count::Fixed(n) if n > MAX_DERIVED_ARRAY_LENGTH)
}

fn rust_type(kind: &FieldType, own: &str) -> String {
    let one = match &kind.base {
        Base::Primitive(primitive) => primitive.rust().to_string(),
        Base::Text { .. } => "::std::string::String".to_string(),
        Base::Message(name) if name.package == own => format!("crate::msg::{}", name.name),
        Base::Message(name) => format!("crate::{}::msg::{}", name.package, name.name),
    };
    match kind.count {
        Count::One => one,
        Count::Fixed(n) => format!("[{one}; {n}]"),
        Count::Sequence { .. } => format!("::std::vec::Vec<{one}>"),
    }
}

fn write_constants(out: &mut String, part: &Part, name: &str) {
    if part.constants.is_empty() {
        return;
    }
    out.push_str(&format!("impl {name} {{\n"));
    for constant in &part.constants {
        let value = rust_value(&constant.value, &constant.kind, true);
        let replacement = format!("`{} {} = {value}`", constant.kind.written, constant.name);
        doc_comments::write(out, "    ", &constant.docs, &replacement);
        let kind = match &constant.kind.base {
            Base::Primitive(primitive) => primitive.rust(),
            Base::Text { .. } | Base::Message(_) => "&'static str",
        };
        let rust_name = field_name(&constant.name);
        out.push_str(&format!("    pub const {rust_name}: {kind} = {value};\n"));
    }
    out.push_str("}\n\n");
}

fn write_default(out: &mut String, part: &Part, names: &StructNames) {
    out.push_str(&format!(
        "impl ::std::default::Default for {} {{\n    fn default() -> Self {{\n",
        names.rust
    ));
    out.push_str("        Self {\n");
    for field in &part.fields {
        let value = default_of(field);
        out.push_str(&format!("            {}: {value},\n", field_name(&field.name)));
    }
    out.push_str("        }\n    }\n}\n\n");
}

fn write_interface(out: &mut String, names: &StructNames, definition: &str) {
    out.push_str(&format!("impl ::ros2_client::Message for {} {{}}\n\n", names.rust));
    write_interface_trait(out, names, definition);
}

/// Implements the trait that tells the type's name and definition.
pub(super) fn write_interface_trait(out: &mut String, names: &StructNames, definition: &str) {
    let StructNames { package, kind, ros, rust, .. } = names;
    out.push_str(&format!(
        "impl crate::Interface for {rust} {{\n    \
         const PACKAGE: &'static str = \"{package}\";\n    \
         const KIND: &'static str = \"{kind}\";\n    \
         const NAME: &'static str = \"{ros}\";\n    \
         const TYPE_NAME: &'static str = \"{package}/{kind}/{ros}\";\n    \
         const DEFINITION: &'static str = {definition:?};\n}}\n\n"
    ));
}

/// A field's name in Rust: keywords become raw, and those that cannot get a `_`.
fn field_name(name: &str) -> String {
    const KEYWORDS: [&str; 48] = [
        "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "do",
        "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl", "in",
        "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref",
        "return", "static", "struct", "trait", "true", "try", "type", "typeof", "unsafe",
        "unsized", "use", "virtual", "where", "while", "yield",
    ];
    match name {
        "self" | "super" | "crate" => format!("{name}_"),
        _ if KEYWORDS.contains(&name) => format!("r#{name}"),
        _ => name.to_string(),
    }
}
