//! `puffer register`: corrected poses and a verdict on each scan.

use super::input::{InputArgs, OpenedInput, check_output};
use crate::parameters::ParameterArgs;
use crate::progress::TerminalProgress;
use crate::table::ResultTable;
use crate::verdict_report;
use anyhow::Result;
use clap::Args;
use puffer_core::geometry::log;
use puffer_core::pipeline::{prepare_scans, register_scans};
use puffer_core::register::Verdict;
use puffer_core::scan_files::write_poses;
use puffer_core::verdict::{ModelVerdict, ScanCount};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Aligns the scans to each other, the robot's poses being the prior.
#[derive(Args)]
pub struct RegisterCommand {
    #[command(flatten)]
    input: InputArgs,
    /// Corrected poses.json to write
    #[arg(short, long, value_name = "POSES")]
    output: PathBuf,
    #[command(flatten)]
    parameters: ParameterArgs,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

impl RegisterCommand {
    pub(super) fn run(&self) -> Result<()> {
        check_output(&self.output, &["json"])?;
        let watch = TerminalProgress::start();
        let OpenedInput { data: files, params, .. } =
            self.input.open_scans(&self.parameters, watch.progress())?;
        let prepared = self.input.with_input_name(prepare_scans(&files, watch.progress()))?;
        let registration = self.input.with_input_name(register_scans(
            &prepared,
            self.input.poses(),
            &params.register,
            watch.progress(),
        ))?;
        let times = watch.finish();
        let extras: Vec<Value> =
            registration.verdicts.iter().map(|v| json!({ "verdict": verdict_json(v) })).collect();
        write_poses(&self.output, &files, &registration.poses, &extras)?;
        let mut report = ResultTable::default();
        for (i, verdict) in registration.verdicts.iter().enumerate() {
            let xi = log(&(prepared.robot_poses[i].inverse() * registration.poses[i]));
            let text = format!(
                "{:<8}  moved {:6.2} mm, {:5.2} degrees  overlap {:3.0} %  {}",
                verdict.status.word(),
                xi.fixed_rows::<3>(0).norm() * 1e3,
                xi.fixed_rows::<3>(3).norm().to_degrees(),
                verdict.overlap * 100.0,
                verdict.reason
            );
            report.add(&prepared.names[i], text, &prepared.names[i], verdict.status.word());
        }
        let scans = ScanCount::from_verdicts(&registration.verdicts);
        report.add_value("accepted_scans", scans.map(|scans| scans.accepted()));
        let on_the_whole = ModelVerdict { scans, cells_explained: None };
        verdict_report::add_verdict(&mut report, &on_the_whole);
        let residual = registration.residual.unwrap_or(f64::NAN) * 1e3;
        report.add(
            "residual",
            format!("{residual:.3} mm between overlapping scans"),
            "residual_mm",
            residual,
        );
        let seconds: f64 = times.iter().map(|(_, time)| time.as_secs_f64()).sum();
        report.add("time", format!("{seconds:.1} s"), "seconds", seconds);
        report.print(self.json);
        // The poses are written in any case, each with its verdict.
        verdict_report::ensure_trustworthy(&on_the_whole, true, "")
    }
}

fn verdict_json(verdict: &Verdict) -> Value {
    let rows: Vec<Vec<f64>> =
        verdict.covariance.row_iter().map(|row| row.iter().copied().collect()).collect();
    let free: Vec<Vec<f64>> =
        verdict.free_directions.iter().map(|twist| twist.iter().copied().collect()).collect();
    json!({
        "status": verdict.status.word(),
        "reason": verdict.reason,
        "fitness": verdict.fitness,
        "overlap": verdict.overlap,
        "rmse": verdict.rmse,
        "correspondences": verdict.correspondences,
        "covariance": rows,
        "free_directions": free,
    })
}
