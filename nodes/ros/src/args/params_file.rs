//! ROS parameter files: below a node's name and `ros__parameters` stand the values, with nested
//! names or with dots in them.

use super::{Scope, Setting};
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::path::Path;

/// The key above a node's parameters.
const PARAMETERS_KEY: &str = "ros__parameters";

/// All settings of a parameter file, in order.
pub(super) fn read(path: &Path) -> Result<Vec<Setting>> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the parameter file {}", path.display()))?;
    parse(&text, &path.display().to_string())
}

/// All settings of the text of a parameter file, in order; `origin` names the file.
pub(super) fn parse(text: &str, origin: &str) -> Result<Vec<Setting>> {
    let document: Value =
        serde_yaml_ng::from_str(text).with_context(|| format!("{origin}: not valid YAML"))?;
    let mut settings = Vec::new();
    if !document.is_null() {
        collect_nodes(&document, "", origin, &mut settings)?;
    }
    Ok(settings)
}

/// Collects the settings below `value`; the keys above `ros__parameters` make the node's name.
fn collect_nodes(
    value: &Value,
    path: &str,
    origin: &str,
    settings: &mut Vec<Setting>,
) -> Result<()> {
    let map = value.as_object().filter(|map| !map.is_empty()).with_context(|| {
        format!(
            "{origin}: no `{PARAMETERS_KEY}` under `{path}`; expected `node_name: {{{PARAMETERS_KEY}: {{group: {{field: value}}}}}}`"
        )
    })?;
    for (key, value) in map {
        if key == PARAMETERS_KEY {
            let scope = if path.is_empty() {
                bail!(
                    "{origin}: `{PARAMETERS_KEY}` at the top; put it under a node's name, or under `/**` for all nodes"
                );
            } else {
                Scope::Pattern(path.to_owned())
            };
            collect_parameters(value, "", &scope, origin, settings)?;
        } else if path.is_empty() {
            collect_nodes(value, key, origin, settings)?;
        } else {
            collect_nodes(
                value,
                &format!("{}/{key}", path.trim_end_matches('/')),
                origin,
                settings,
            )?;
        }
    }
    Ok(())
}

/// Collects the settings of one node; nested keys make the parameter's name.
fn collect_parameters(
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
                collect_parameters(value, &name, scope, origin, settings)?;
            }
            Ok(())
        }
        Value::Null if prefix.is_empty() => Ok(()),
        _ if prefix.is_empty() => {
            bail!("{origin}: `{PARAMETERS_KEY}` holds {value}; expected a map of names to values")
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
