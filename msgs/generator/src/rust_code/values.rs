//! Values as Rust expressions.

use crate::model::{Base, Count, Field, FieldType, Primitive, Value};

/// The field's value in `Default`.
pub(super) fn default_of(field: &Field) -> String {
    match (&field.default, field.kind.count) {
        (Some(value), _) => rust_value(value, &field.kind, false),
        (None, Count::Fixed(_)) => {
            "::std::array::from_fn(|_| ::std::default::Default::default())".to_string()
        }
        (None, _) => "::std::default::Default::default()".to_string(),
    }
}

/// The value; a text as `&str` where that will do.
pub(super) fn rust_value(value: &Value, kind: &FieldType, borrowed: bool) -> String {
    match value {
        Value::Bool(value) => value.to_string(),
        Value::Integer(value) => value.to_string(),
        Value::Float(value) => float(*value, &kind.base),
        Value::Text(text) if borrowed => format!("{text:?}"),
        Value::Text(text) => format!("::std::string::String::from({text:?})"),
        Value::List(values) => {
            let all: Vec<String> = values.iter().map(|v| rust_value(v, kind, borrowed)).collect();
            let open = if matches!(kind.count, Count::Fixed(_)) { "[" } else { "vec![" };
            format!("{open}{}]", all.join(", "))
        }
    }
}

fn float(value: f64, base: &Base) -> String {
    let single = *base == Base::Primitive(Primitive::F32);
    let name = if single { "f32" } else { "f64" };
    if value.is_nan() {
        format!("{name}::NAN")
    } else if value.is_infinite() {
        format!("{name}::{}", if value > 0.0 { "INFINITY" } else { "NEG_INFINITY" })
    } else if single {
        format!("{:?}", value as f32)
    } else {
        format!("{value:?}")
    }
}
