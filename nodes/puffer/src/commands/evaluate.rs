//! `puffer evaluate`: a mesh against the truth.

use crate::progress::TerminalProgress;
use crate::table::print_rows;
use anyhow::Result;
use clap::Args;
use puffer_core::assess::{AssessParams, Assessment, assess};
use puffer_core::mesh::io::{read_cloud, read_mesh};
use serde_json::Value;
use std::path::PathBuf;

/// Gates, distances both ways (mm), triangle quality and calibration.
#[derive(Args)]
pub struct EvaluateCommand {
    /// Mesh to measure
    mesh: PathBuf,
    /// True mesh, in the same frame
    #[arg(long, value_name = "MESH")]
    truth: PathBuf,
    /// PLY with the points of the truth that the scans saw (`seen.ply` of `puffer simulate`)
    #[arg(long, value_name = "POINTS")]
    seen: Option<PathBuf>,
    /// Samples each way
    #[arg(long, default_value_t = AssessParams::default().samples)]
    samples: usize,
    /// Seed of the samples
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

impl EvaluateCommand {
    pub(super) fn run(&self) -> Result<()> {
        let (mesh, truth) = (read_mesh(&self.mesh)?, read_mesh(&self.truth)?);
        let seen = self.seen.as_deref().map(read_cloud).transpose()?.map(|cloud| cloud.points);
        let params = AssessParams {
            samples: self.samples,
            seed: self.seed,
            seen,
            ..AssessParams::default()
        };
        let watch = TerminalProgress::start();
        let assessment = assess(&mesh, &truth, &params, watch.progress())?;
        watch.finish();
        print(&assessment, self.json)
    }
}

/// Rows that are printed first: the distance from the mesh to the truth says little of a mesh that
/// leaves out most of the object, so completeness is printed beside it.
const FIRST_ROWS: [&str; 3] = ["crms_rms", "accuracy_rms", "completeness_rms"];

fn print(assessment: &Assessment, json: bool) -> Result<()> {
    let value = serde_json::to_value(assessment)?;
    if json {
        println!("{value}");
        return Ok(());
    }
    let mut figures: Vec<(&String, &Value)> = value.as_object().into_iter().flatten().collect();
    figures.sort_by_key(|(key, _)| {
        FIRST_ROWS.iter().position(|first| first == key).unwrap_or(FIRST_ROWS.len())
    });
    let rows = figures.into_iter().map(|(key, value)| {
        let text = match value {
            Value::Null => "-".to_owned(),
            Value::Number(n) if n.is_f64() => format!("{:.4}", n.as_f64().unwrap_or(f64::NAN)),
            other => other.to_string(),
        };
        (key.clone(), text)
    });
    print_rows(&rows.collect::<Vec<_>>());
    Ok(())
}
