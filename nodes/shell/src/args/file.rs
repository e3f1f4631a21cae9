//! ROS parameter files: node name -> `ros__parameters` -> values, nested or with dots.

use super::{Scope, Setting};
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::path::Path;

const MARK: &str = "ros__parameters";

pub(super) fn read(path: &Path) -> Result<Vec<Setting>> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the parameter file {}", path.display()))?;
    settings(&text, &path.display().to_string())
}

/// All settings of a parameter file's text, in order.
pub(super) fn settings(text: &str, origin: &str) -> Result<Vec<Setting>> {
    let document: Value =
        serde_yaml_ng::from_str(text).with_context(|| format!("{origin}: not valid YAML"))?;
    let mut settings = Vec::new();
    if !document.is_null() {
        nodes(&document, "", origin, &mut settings)?;
    }
    Ok(settings)
}

/// Keys above `ros__parameters` make the node's name.
fn nodes(value: &Value, path: &str, origin: &str, settings: &mut Vec<Setting>) -> Result<()> {
    let map = value.as_object().filter(|map| !map.is_empty()).with_context(|| {
        format!(
            "{origin}: no `{MARK}` under `{path}`; expected `node_name: {{{MARK}: {{group: {{field: value}}}}}}`"
        )
    })?;
    for (key, value) in map {
        if key == MARK {
            let scope = if path.is_empty() {
                bail!(
                    "{origin}: `{MARK}` at the top; put it under a node's name, or under `/**` for all nodes"
                );
            } else {
                Scope::Pattern(path.to_owned())
            };
            parameters(value, "", &scope, origin, settings)?;
        } else if path.is_empty() {
            nodes(value, key, origin, settings)?;
        } else {
            nodes(value, &format!("{}/{key}", path.trim_end_matches('/')), origin, settings)?;
        }
    }
    Ok(())
}

fn parameters(
    value: &Value,
    prefix: &str,
    scope: &Scope,
    origin: &str,
    settings: &mut Vec<Setting>,
) -> Result<()> {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
                parameters(value, &name, scope, origin, settings)?;
            }
            Ok(())
        }
        Value::Null if prefix.is_empty() => Ok(()),
        _ if prefix.is_empty() => {
            bail!("{origin}: `{MARK}` holds {value}; expected a map of names to values")
        }
        value => {
            settings.push(Setting {
                scope: scope.clone(),
                name: prefix.to_owned(),
                value: value.clone(),
                origin: origin.to_owned(),
            });
            Ok(())
        }
    }
}
