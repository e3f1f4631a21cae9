//! Parameters between JSON and `rcl_interfaces`.

use puffer_core::params::ParamSpec;
use puffer_msgs::rcl_interfaces::msg::{
    FloatingPointRange, IntegerRange, ParameterDescriptor, ParameterType, ParameterValue,
};
use serde_json::Value;

pub(super) fn to_json(value: &ParameterValue) -> Result<Value, String> {
    match value.r#type {
        ParameterType::PARAMETER_BOOL => Ok(Value::from(value.bool_value)),
        ParameterType::PARAMETER_INTEGER => Ok(Value::from(value.integer_value)),
        ParameterType::PARAMETER_DOUBLE => Ok(Value::from(value.double_value)),
        ParameterType::PARAMETER_STRING => Ok(Value::from(value.string_value.clone())),
        ParameterType::PARAMETER_NOT_SET => {
            Err("a parameter cannot be deleted, only set to another value".to_owned())
        }
        _ => Err("an array; no parameter of this node is one".to_owned()),
    }
}

/// `kind` is that of [`ParamSpec`].
pub(super) fn from_json(kind: &str, value: &Value) -> ParameterValue {
    let mut message = ParameterValue { r#type: type_of(kind), ..Default::default() };
    match kind {
        "float" => message.double_value = value.as_f64().unwrap_or(f64::NAN),
        "integer" => message.integer_value = value.as_i64().unwrap_or(i64::MAX),
        "boolean" => message.bool_value = value.as_bool().unwrap_or_default(),
        _ => message.string_value = value.as_str().unwrap_or_default().to_owned(),
    }
    message
}

pub(super) fn type_of(kind: &str) -> u8 {
    match kind {
        "float" => ParameterType::PARAMETER_DOUBLE,
        "integer" => ParameterType::PARAMETER_INTEGER,
        "boolean" => ParameterType::PARAMETER_BOOL,
        _ => ParameterType::PARAMETER_STRING,
    }
}

pub(super) fn descriptor(spec: &ParamSpec) -> ParameterDescriptor {
    let mut message = ParameterDescriptor {
        name: spec.name.clone(),
        r#type: type_of(spec.kind),
        description: spec.description.clone(),
        ..Default::default()
    };
    if !spec.unit.is_empty() {
        message.description.push_str(&format!(" Unit: {}.", spec.unit));
    }
    if !spec.choices.is_empty() {
        message.additional_constraints = format!("one of {}", spec.choices.join(", "));
    }
    if let Some([low, high]) = spec.range {
        match spec.kind {
            "integer" => message.integer_range.push(IntegerRange {
                from_value: low as i64,
                to_value: high as i64,
                step: 1,
            }),
            _ => message.floating_point_range.push(FloatingPointRange {
                from_value: low,
                to_value: high,
                step: 0.0,
            }),
        }
    }
    message
}
