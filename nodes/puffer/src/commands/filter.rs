//! `puffer filter`: one cloud with uncertainty.

use super::input::{InputArgs, OpenedInput, check_output};
use crate::parameters::ParameterArgs;
use crate::progress::TerminalProgress;
use crate::table::ResultTable;
use crate::verdict_report;
use anyhow::Result;
use clap::Args;
use puffer_core::mesh::io::write_cloud;
use puffer_core::pipeline::{
    PipelineInput, PipelineParams, PoseSource, filter_scans, prepare_scans, register_scans,
};
use puffer_core::scan::PreparedScan;
use puffer_core::verdict::{ModelVerdict, ScanCount};
use puffer_core::{Progress, filter, geometry};
use std::path::PathBuf;

/// Combines redundant measurements and drops outliers.
#[derive(Args)]
pub struct FilterCommand {
    #[command(flatten)]
    input: InputArgs,
    /// Cloud to write, .ply
    #[arg(short, long, value_name = "CLOUD")]
    output: PathBuf,
    #[command(flatten)]
    parameters: ParameterArgs,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

impl FilterCommand {
    pub(super) fn run(&self) -> Result<()> {
        check_output(&self.output, &["ply"])?;
        let watch = TerminalProgress::start();
        let OpenedInput { data: input, params, .. } =
            self.input.open(&self.parameters, watch.progress())?;
        let (filtered, scans) = self.input.with_input_name(filter_input(
            &input,
            self.input.poses(),
            &params,
            watch.progress(),
        ))?;
        watch.finish();
        write_cloud(
            &self.output,
            &filtered.cloud,
            &[format!("puffer {}", env!("CARGO_PKG_VERSION"))],
        )?;
        let mut report = ResultTable::default();
        let points = filtered.cloud.len();
        report.add("points", format!("{points} of {}", filtered.measurements), "points", points);
        report.add_value("measurements", filtered.measurements);
        for (label, key, value) in [
            ("noise radius", "noise_radius_mm", filtered.noise_radius),
            ("reduction radius", "reduction_radius_mm", filtered.reduction_radius),
        ] {
            report.add(label, format!("{:.3} mm", value * 1e3), key, value * 1e3);
        }
        let on_the_whole = ModelVerdict { scans, cells_explained: None };
        if scans.is_some() {
            verdict_report::add_verdict(&mut report, &on_the_whole);
        }
        report.add(
            "written",
            self.output.display().to_string(),
            "cloud",
            self.output.display().to_string(),
        );
        report.print(self.json);
        // The cloud is what was asked for: nothing is held back.
        verdict_report::ensure_trustworthy(&on_the_whole, true, "")
    }
}

/// The cloud, and how many scans it was made of.
fn filter_input(
    input: &PipelineInput,
    poses: PoseSource,
    params: &PipelineParams,
    progress: &Progress,
) -> puffer_core::Result<(filter::Filtered, Option<ScanCount>)> {
    match input {
        PipelineInput::Scans(files) => {
            let prepared = prepare_scans(files, progress)?;
            let registration = register_scans(&prepared, poses, &params.register, progress)?;
            let filtered = filter_scans(&prepared, &registration, &params.filter, progress)?;
            Ok((filtered, ScanCount::from_verdicts(&registration.verdicts)))
        }
        PipelineInput::Cloud(cloud) => {
            let scan = PreparedScan::from_cloud(cloud)?;
            let scans = [(&scan, geometry::Pose::identity())];
            Ok((filter::filter(&scans, None, &params.filter, progress)?, None))
        }
    }
}
