//! Parameters from a YAML file and from the command line.

use crate::exit_status::usage_error;
use anyhow::{Context, Result};
use clap::Args;
use puffer_core::params::Parameters;
use puffer_core::pipeline::PipelineParams;
use serde_json::Value;
use std::path::PathBuf;

/// Where parameters that differ from their defaults come from.
#[derive(Args)]
pub struct ParameterArgs {
    /// YAML file with parameters (`puffer params --yaml` writes one with all defaults)
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Sets one parameter, as in --set reconstruct.edge_length=0.002; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<String>,
}

impl ParameterArgs {
    /// Defaults, overridden by the file, overridden by the settings.
    pub fn load(&self) -> Result<PipelineParams> {
        self.load_onto(PipelineParams::default())
    }

    /// `params`, overridden by the file, overridden by the settings.
    pub fn load_onto<P: Parameters>(&self, mut params: P) -> Result<P> {
        if let Some(path) = &self.params {
            let text = std::fs::read_to_string(path)
                .with_context(|| format!("cannot read the parameter file {}", path.display()))?;
            let document: Value = serde_yaml_ng::from_str(&text).map_err(|error| {
                usage_error(format!("{}: not valid YAML: {error}", path.display()))
            })?;
            if !document.is_null() {
                params.set_all(&document).with_context(|| path.display().to_string())?;
            }
        }
        for setting in &self.settings {
            let parsed = setting
                .split_once('=')
                .and_then(|(name, value)| Some((name.split_once('.')?, value)));
            let ((group, field), value) = parsed.ok_or_else(|| {
                usage_error(format!(
                    "--set {setting}: expected NAME=VALUE, such as filter.noise_radius=0.002"
                ))
            })?;
            // What is no number and no boolean is a word.
            let value = serde_json::from_str(value).unwrap_or_else(|_| Value::from(value));
            params.set_named(group, field, &value)?;
        }
        Ok(params)
    }
}
