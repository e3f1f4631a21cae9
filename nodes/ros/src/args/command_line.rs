//! The arguments between `--ros-args` and `--`.

use super::{RosArgs, Scope, Setting, params_file};
use crate::names::Remap;
use anyhow::{Context, Result, bail};
use std::path::Path;

/// Takes over the arguments, ROS arguments into their fields and others into `rest`.
pub(super) fn read(parsed: &mut RosArgs, args: impl IntoIterator<Item = String>) -> Result<()> {
    let mut args = args.into_iter();
    let mut inside = false;
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--ros-args" => inside = true,
            "--" if inside => inside = false,
            _ if inside => read_ros_arg(parsed, &arg, &mut args)?,
            _ => parsed.rest.push(arg),
        }
    }
    Ok(())
}

/// Takes over a ROS argument and its value, which is the next one of `args`.
fn read_ros_arg(
    parsed: &mut RosArgs,
    arg: &str,
    args: &mut impl Iterator<Item = String>,
) -> Result<()> {
    match arg {
        "-r" | "--remap" => {
            parsed.remaps.push(parse_remap(&next_value(arg, args, "a rule such as from:=to")?)?)
        }
        "-p" | "--param" => {
            parsed.settings.push(parse_setting(&next_value(arg, args, "name:=value")?)?)
        }
        "--params-file" => {
            parsed
                .settings
                .extend(params_file::read(Path::new(&next_value(arg, args, "a file")?))?);
        }
        "--log-level" => set_level(parsed, &next_value(arg, args, "a level such as info")?)?,
        "--enable-rosout-logs" => parsed.logs.rosout = true,
        "--disable-rosout-logs" => parsed.logs.rosout = false,
        "--enable-stdout-logs" => parsed.logs.stdout = true,
        "--disable-stdout-logs" => parsed.logs.stdout = false,
        // Accepted as rcl does; there is no external logging library and no enclave here.
        "--enable-external-lib-logs" | "--disable-external-lib-logs" => {}
        "--log-config-file" | "--log-file-name" | "-e" | "--enclave" => {
            next_value(arg, args, "a value")?;
        }
        other => bail!(
            "unknown ROS argument `{other}`; known are -r from:=to, -p name:=value, --params-file FILE, \
             --log-level LEVEL, --enable-|--disable-{{rosout,stdout,external-lib}}-logs, and -- to end them"
        ),
    }
    Ok(())
}

/// The value of an argument, which `what` describes.
fn next_value(arg: &str, args: &mut impl Iterator<Item = String>, what: &str) -> Result<String> {
    args.next().with_context(|| format!("{arg} needs {what} after it"))
}

/// Reads a remapping rule `[node:]from:=to`.
fn parse_remap(rule: &str) -> Result<Remap> {
    let parts = rule.split_once(":=").filter(|(from, to)| !from.is_empty() && !to.is_empty());
    let (from, to) = parts.with_context(|| {
        format!("`{rule}` is no remapping rule; expected from:=to, such as points:=/camera/points")
    })?;
    let (node, from) = match from.split_once(':') {
        Some((node, rest)) if !rest.starts_with("//") => (Some(node.to_owned()), rest),
        _ => (None, from),
    };
    Ok(Remap { node, from: from.to_owned(), to: to.to_owned() })
}

/// Reads a parameter `[node:]name:=value`, whose value is YAML.
fn parse_setting(text: &str) -> Result<Setting> {
    let parts = text.split_once(":=").filter(|(name, _)| !name.is_empty());
    let (name, value) = parts.with_context(|| {
        format!(
            "`{text}` sets no parameter; expected name:=value, such as filter.noise_radius:=0.002"
        )
    })?;
    let value = serde_yaml_ng::from_str(value)
        .with_context(|| format!("the value of `{text}` is not valid YAML"))?;
    let (scope, name) = match name.split_once(':') {
        Some((node, name)) => (Scope::Pattern(node.to_owned()), name),
        None => (Scope::Any, name),
    };
    Ok(Setting { scope, name: name.to_owned(), value, origin: format!("-p {text}") })
}

/// Takes over `level` or `logger:=level`; every logger of this program is the node's.
fn set_level(parsed: &mut RosArgs, text: &str) -> Result<()> {
    let level = text.rsplit_once(":=").map_or(text, |(_, level)| level).to_ascii_lowercase();
    if !["debug", "info", "warn", "error", "fatal"].contains(&level.as_str()) {
        bail!("--log-level {text}: the levels are debug, info, warn, error, fatal");
    }
    parsed.logs.level = level;
    Ok(())
}
