//! Parameters as rcl_interfaces has them.

use puffer_core::params::ParamSpec;
use puffer_msgs::rcl_interfaces::msg::{
    FloatingPointRange, IntegerRange, ParameterDescriptor, ParameterType, ParameterValue,
};
use serde_json::Value;

fn type_of(kind: &str) -> u8 {
    match kind {
        "float" => ParameterType::PARAMETER_DOUBLE,
        "integer" => ParameterType::PARAMETER_INTEGER,
        "boolean" => ParameterType::PARAMETER_BOOL,
        _ => ParameterType::PARAMETER_STRING,
    }
}

pub(super) fn to_ros(spec: &ParamSpec, value: &Value) -> ParameterValue {
    let mut ros = ParameterValue { r#type: type_of(spec.kind), ..Default::default() };
    match ros.r#type {
        ParameterType::PARAMETER_DOUBLE => ros.double_value = value.as_f64().unwrap_or(f64::NAN),
        ParameterType::PARAMETER_INTEGER => ros.integer_value = value.as_i64().unwrap_or(i64::MAX),
        ParameterType::PARAMETER_BOOL => ros.bool_value = value.as_bool().unwrap_or_default(),
        _ => value.as_str().unwrap_or_default().clone_into(&mut ros.string_value),
    }
    ros
}

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

pub(super) fn describe(spec: &ParamSpec, read_only: bool) -> ParameterDescriptor {
    let unit = if spec.unit.is_empty() { String::new() } else { format!(" ({})", spec.unit) };
    let mut descriptor = ParameterDescriptor {
        name: spec.name.clone(),
        r#type: type_of(spec.kind),
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
