//! `puffer reconstruct`: from scans to a watertight mesh.

use super::input::{InputArgs, OpenedInput, check_output};
use crate::parameters::ParameterArgs;
use crate::progress::TerminalProgress;
use crate::table::{ResultTable, yes_or_no};
use crate::verdict_report;
use anyhow::Result;
use clap::Args;
use puffer_core::mesh::io::write_mesh;
use puffer_core::mesh::{Mesh, components, genus, is_closed, is_oriented, is_two_manifold};
use puffer_core::pipeline::{PipelineOutcome, mesh_comments, run};
use std::path::PathBuf;
use std::time::Duration;

/// Registers, filters, inflates and details; every parameter is taken from the data unless given.
#[derive(Args)]
pub struct ReconstructCommand {
    #[command(flatten)]
    input: InputArgs,
    /// Mesh to write: .ply (with uncertainty), .stl, .obj or .glb
    #[arg(short, long, value_name = "MESH")]
    output: PathBuf,
    #[command(flatten)]
    parameters: ParameterArgs,
    /// Seed for whatever is left to chance [default: that of the run that a bag came from, or 0]
    #[arg(long)]
    seed: Option<u64>,
    /// Write the mesh also where fewer than half of the scans are accepted, or less than half of
    /// the measured surface is explained by it
    #[arg(long)]
    force: bool,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

impl ReconstructCommand {
    pub(super) fn run(&self) -> Result<()> {
        check_output(&self.output, &["ply", "stl", "obj", "glb"])?;
        let watch = TerminalProgress::start();
        let OpenedInput { data, params, seed } =
            self.input.open(&self.parameters, watch.progress())?;
        let outcome = self.input.with_input_name(run(
            &data,
            self.input.poses(),
            &params,
            watch.progress(),
        ))?;
        let times = watch.finish();
        let how = "call again with --force to have it all the same";
        let passed = verdict_report::ensure_trustworthy(&outcome.verdict, self.force, how);
        if passed.is_ok() {
            let comments = mesh_comments(&outcome.cloud, self.seed.or(seed).unwrap_or(0));
            write_mesh(&self.output, &outcome.mesh, &comments)?;
        }
        self.report(&outcome, &times, passed.is_ok()).print(self.json);
        passed
    }

    fn report(
        &self,
        outcome: &PipelineOutcome,
        times: &[(String, Duration)],
        written: bool,
    ) -> ResultTable {
        let mut report = ResultTable::default();
        registration_rows(&mut report, outcome);
        let points = outcome.cloud.len();
        let text = format!("{points} points from {} measurements", outcome.measurements);
        report.add("filtered", text, "filtered_points", points);
        report.add_value("measurements", outcome.measurements);
        mesh_rows(&mut report, &outcome.mesh);
        let mut total = 0.0;
        let mut parts = Vec::new();
        let mut json = serde_json::Map::new();
        for (stage, time) in times {
            total += time.as_secs_f64();
            parts.push(format!("{stage} {:.1} s", time.as_secs_f64()));
            json.insert(stage.clone(), time.as_secs_f64().into());
        }
        report.add("time", format!("{total:.1} s ({})", parts.join(", ")), "seconds", total);
        report.add_value("stage_seconds", json);
        if let Some(peak) = peak_memory_bytes() {
            report.add("peak memory", format!("{:.2} GB", peak / 1e9), "peak_memory_bytes", peak);
        }
        let path = written.then(|| self.output.display().to_string());
        let text = path.as_deref().unwrap_or("no mesh");
        report.add("written", text, "mesh", path.clone());
        verdict_report::add_verdict(&mut report, &outcome.verdict);
        report
    }
}

fn registration_rows(report: &mut ResultTable, outcome: &PipelineOutcome) {
    let Some(registration) = &outcome.registration else { return };
    let total = registration.verdicts.len();
    let accepted = registration.verdicts.iter().filter(|v| v.is_accepted()).count();
    report.add("scans", format!("{accepted} of {total} accepted"), "accepted_scans", accepted);
    for (name, verdict) in outcome.names.iter().zip(&registration.verdicts) {
        if !verdict.is_accepted() {
            eprintln!("puffer: {name} {}: {}", verdict.status.word(), verdict.reason);
        }
    }
    if let Some(residual) = registration.residual {
        let millimetres = residual * 1e3;
        let text = format!("{millimetres:.3} mm between overlapping scans");
        report.add("registration", text, "registration_residual_mm", millimetres);
    }
}

fn mesh_rows(report: &mut ResultTable, mesh: &Mesh) {
    let (vertices, triangles) = (mesh.vertices.len(), mesh.triangles.len());
    report.add("mesh", format!("{vertices} vertices, {triangles} triangles"), "vertices", vertices);
    report.add_value("triangles", triangles);
    let size = mesh.aabb().extent() * 1e3;
    let volume = mesh.volume() * 1e6;
    let text = format!("{:.1} x {:.1} x {:.1} mm, {volume:.1} cm3", size.x, size.y, size.z);
    report.add("size", text, "size_mm", vec![size.x, size.y, size.z]);
    report.add_value("volume_cm3", volume);
    let (closed, manifold, oriented) = (is_closed(mesh), is_two_manifold(mesh), is_oriented(mesh));
    let (genus, components) = (genus(mesh), components(mesh));
    let text = format!(
        "closed {}, two-manifold {}, oriented {}, genus {}, components {}",
        yes_or_no(closed),
        yes_or_no(manifold),
        yes_or_no(oriented),
        genus.map_or_else(|| "undefined".to_owned(), |g| g.to_string()),
        components
    );
    report.add("topology", text, "closed", closed);
    report.add_value("two_manifold", manifold);
    report.add_value("oriented", oriented);
    report.add_value("genus", genus);
    report.add_value("components", components);
    let measured: Vec<f64> = mesh.sigma.iter().copied().filter(|s| s.is_finite()).collect();
    let mean = measured.iter().sum::<f64>() / measured.len().max(1) as f64 * 1e3;
    let unobserved = 1.0 - measured.len() as f64 / vertices.max(1) as f64;
    let text =
        format!("mean {mean:.3} mm; {:.1} % of the vertices not observed", unobserved * 100.0);
    report.add("uncertainty", text, "mean_sigma_mm", mean);
    report.add_value("unobserved_share", unobserved);
}

/// Largest resident size of this process so far, bytes; known on Linux only.
fn peak_memory_bytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes * 1024.0)
}
