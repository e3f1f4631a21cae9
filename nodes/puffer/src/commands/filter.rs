//! `puffer filter`: one cloud with uncertainty.

use super::input::{InputArgs, Job, check_output};
use crate::parameters::ParameterArgs;
use crate::progress::Watch;
use crate::table::Report;
use crate::verdict;
use anyhow::Result;
use clap::Args;
use puffer_core::mesh::io::write_cloud;
use puffer_core::pipeline::{Input, Params, Poses, filter_scans, prepare, register_scans};
use puffer_core::register::PreparedScan;
use puffer_core::verdict::{ModelVerdict, ScanCount};
use puffer_core::{Progress, filter, geometry};
use std::path::PathBuf;

/// Combines redundant measurements and drops outliers.
#[derive(Args)]
pub struct Filter {
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

impl Filter {
    pub(super) fn run(&self) -> Result<()> {
        check_output(&self.output, &["ply"])?;
        let watch = Watch::start();
        let Job { data: input, params, .. } =
            self.input.open(&self.parameters, watch.progress())?;
        let (filtered, scans) =
            self.input.named(filtered(&input, self.input.poses(), &params, watch.progress()))?;
        watch.finish();
        write_cloud(
            &self.output,
            &filtered.cloud,
            &[format!("puffer {}", env!("CARGO_PKG_VERSION"))],
        )?;
        let mut report = Report::default();
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
            verdict::add(&mut report, &on_the_whole);
        }
        report.add(
            "written",
            self.output.display().to_string(),
            "cloud",
            self.output.display().to_string(),
        );
        report.print(self.json);
        // The cloud is what was asked for: nothing is held back.
        verdict::pass(&on_the_whole, true, "")
    }
}

/// The cloud, and how many scans it was made of.
fn filtered(
    input: &Input,
    poses: Poses,
    params: &Params,
    progress: &Progress,
) -> puffer_core::Result<(filter::Filtered, Option<ScanCount>)> {
    match input {
        Input::Scans(files) => {
            let prepared = prepare(files, progress)?;
            let registration = register_scans(&prepared, poses, &params.register, progress)?;
            let filtered = filter_scans(&prepared, &registration, &params.filter, progress)?;
            Ok((filtered, ScanCount::from_verdicts(&registration.verdicts)))
        }
        Input::Cloud(cloud) => {
            let scan = PreparedScan::of_cloud(cloud)?;
            let scans = [(&scan, geometry::Pose::identity())];
            Ok((filter::filter(&scans, f64::NAN, &params.filter, progress)?, None))
        }
    }
}
