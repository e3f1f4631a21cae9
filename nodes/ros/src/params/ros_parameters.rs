//! Parameters as messages of rcl_interfaces.

use puffer_core::params::ParamSpec;
use puffer_msgs::rcl_interfaces::msg::{
    FloatingPointRange, IntegerRange, ParameterDescriptor, ParameterType, ParameterValue,
};
use serde_json::Value;

/// The type of a parameter as a constant of rcl_interfaces.
fn parameter_type(kind: &str) -> u8 {
    match kind {
        "float" => ParameterType::PARAMETER_DOUBLE,
        "integer" => ParameterType::PARAMETER_INTEGER,
        "boolean" => ParameterType::PARAMETER_BOOL,
        _ => ParameterType::PARAMETER_STRING,
    }
}

/// The message of a value.
pub(super) fn to_ros(spec: &ParamSpec, value: &Value) -> ParameterValue {
    let mut ros = ParameterValue { r#type: parameter_type(spec.kind), ..Default::default() };
    match ros.r#type {
        ParameterType::PARAMETER_DOUBLE => ros.double_value = value.as_f64().unwrap_or(f64::NAN),
        ParameterType::PARAMETER_INTEGER => ros.integer_value = value.as_i64().unwrap_or(i64::MAX),
        ParameterType::PARAMETER_BOOL => ros.bool_value = value.as_bool().unwrap_or_default(),
        _ => value.as_str().unwrap_or_default().clone_into(&mut ros.string_value),
    }
    ros
}

/// The value of a message.
///
/// # Errors
/// In words, if it is of a type that no parameter of this crate has.
pub(super) fn from_ros(name: &str, value: &ParameterValue) -> Result<Value, String> {
    match value.r#type {
        ParameterType::PARAMETER_BOOL => Ok(Value::from(value.bool_value)),
        ParameterType::PARAMETER_INTEGER => Ok(Value::from(value.integer_value)),
        ParameterType::PARAMETER_DOUBLE => Ok(Value::from(value.double_value)),
        ParameterType::PARAMETER_STRING => Ok(Value::from(value.string_value.clone())),
        ParameterType::PARAMETER_NOT_SET => Err(format!("parameter {name}: cannot be deleted")),
        _ => Err(format!("parameter {name}: arrays are not taken; give one value")),
    }
}

/// The descriptor of a parameter, as `ros2 param describe` shows it.
pub(super) fn describe(spec: &ParamSpec, read_only: bool) -> ParameterDescriptor {
    let unit = if spec.unit.is_empty() { String::new() } else { format!(" ({})", spec.unit) };
    let mut descriptor = ParameterDescriptor {
        name: spec.name.clone(),
        r#type: parameter_type(spec.kind),
        description: format!("{}{unit}", spec.description),
        read_only,
        ..Default::default()
    };
    if !spec.choices.is_empty() {
        descriptor.additional_constraints = format!("one of {}", spec.choices.join(", "));
    }
    match (spec.range, spec.kind) {
        (Some([from_value, to_value]), "float") => {
            let range = FloatingPointRange { from_value, to_value, step: 0.0 };
            descriptor.floating_point_range.push(range);
        }
        (Some([from, to]), "integer") => {
            let range = IntegerRange { from_value: from as i64, to_value: to as i64, step: 1 };
            descriptor.integer_range.push(range);
        }
        _ => {}
    }
    descriptor
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(kind: &'static str, range: Option<[f64; 2]>) -> ParamSpec {
        let (name, description) = ("scan.radius".to_owned(), "The radius.".to_owned());
        let (default, choices, unit) = (Value::Null, &[], "m");
        ParamSpec { name, kind, default, range, choices, unit, description }
    }

    #[test]
    fn values_survive_the_way_through_messages() {
        for (kind, value) in [
            ("float", Value::from(0.25)),
            ("integer", Value::from(-7)),
            ("boolean", Value::from(true)),
            ("text", Value::from("icp")),
        ] {
            let message = to_ros(&spec(kind, None), &value);
            assert_eq!(from_ros("a.b", &message), Ok(value), "{kind}");
        }
    }

    #[test]
    fn arrays_and_deletions_are_refused_with_the_name() {
        for kind in [ParameterType::PARAMETER_NOT_SET, ParameterType::PARAMETER_DOUBLE_ARRAY] {
            let value = ParameterValue { r#type: kind, ..Default::default() };
            assert!(from_ros("a.b", &value).unwrap_err().starts_with("parameter a.b: "));
        }
    }

    #[test]
    fn a_descriptor_has_unit_and_range() {
        let float = describe(&spec("float", Some([0.5, 2.0])), true);
        assert_eq!(float.description, "The radius. (m)");
        assert!(float.read_only && float.integer_range.is_empty());
        let range = &float.floating_point_range[0];
        assert_eq!((range.from_value, range.to_value, range.step), (0.5, 2.0, 0.0));
        let integer = describe(&spec("integer", Some([1.0, 10.0])), false);
        let range = &integer.integer_range[0];
        assert_eq!((range.from_value, range.to_value, range.step), (1, 10, 1));
        assert!(!integer.read_only && integer.floating_point_range.is_empty());
    }
}
