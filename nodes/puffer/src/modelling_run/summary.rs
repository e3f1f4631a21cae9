//! The table of results.

use crate::table::{ResultTable, yes_or_no};
use crate::verdict_report;
use puffer_core::assess::Assessment;
use puffer_core::verdict::ModelVerdict;
use serde_json::{Map, Value};
use std::path::Path;

/// Stages in their order.
const STAGE_NAMES: [&str; 7] =
    ["plan", "move", "scan", "register", "refine", "filter", "reconstruct"];

/// Prints what came of a run.
pub(crate) fn print_summary(
    report: &Map<String, Value>,
    assessment: Option<&Assessment>,
    folder: &Path,
    json: bool,
) {
    let mut table = ResultTable::default();
    let (scans, accepted) = (number(report, "scans"), number(report, "accepted_scans"));
    let edge = report
        .get("views")
        .and_then(Value::as_array)
        .and_then(|views| views.last()?.get("voxel_edge")?.as_f64())
        .unwrap_or(f64::NAN);
    let text = format!("{scans} ({accepted} registered), voxel edge {:.1} mm", edge * 1e3);
    table.add("scans", text, "scans", scans);
    table.add_value("accepted_scans", accepted);
    table.add_value("voxel_edge_mm", edge * 1e3);
    verdict_report::add_verdict(&mut table, &ModelVerdict::from_json(report));
    let why = report.get("reason").and_then(Value::as_str).unwrap_or_default();
    let coverage = number(report, "coverage");
    let text = format!("{:.1} % of the known surface; ended: {why}", coverage * 100.0);
    table.add("coverage", text, "coverage", coverage);
    if let Some(found) = assessment {
        add_assessment(&mut table, found);
    }
    add_times(&mut table, report);
    let folder = folder.display().to_string();
    table.add("run folder", folder.clone(), "run_folder", folder);
    table.print(json);
}

/// A number of the report; NaN where it has none.
fn number(report: &Map<String, Value>, key: &str) -> f64 {
    report.get(key).and_then(Value::as_f64).unwrap_or(f64::NAN)
}

fn add_assessment(table: &mut ResultTable, found: &Assessment) {
    let topology = &found.topology;
    let text = format!(
        "closed {}, two-manifold {}, oriented {}, genus {}, components {}, self-intersecting faces {}",
        yes_or_no(topology.closed),
        yes_or_no(topology.two_manifold),
        yes_or_no(topology.oriented),
        topology.genus.map_or_else(|| "undefined".to_owned(), |g| g.to_string()),
        topology.components,
        topology.self_intersecting_faces
    );
    table.add("mesh", text, "closed", topology.closed);
    table.add_value("two_manifold", topology.two_manifold);
    table.add_value("oriented", topology.oriented);
    table.add_value("genus", topology.genus);
    table.add_value("components", topology.components);
    table.add_value("self_intersecting_faces", topology.self_intersecting_faces);
    let (accuracy, completeness) = (found.aligned.accuracy_rms, found.aligned.completeness_rms);
    let seen = found.completeness_seen_rms;
    let on_seen = seen.map_or_else(String::new, |seen| format!(" ({seen:.3} mm of what was seen)"));
    let text = format!(
        "cRMS {:.3} mm, accuracy {accuracy:.3} mm, completeness {completeness:.3} mm{on_seen}",
        found.crms_rms
    );
    table.add("deviation, rms", text, "crms_rms", found.crms_rms);
    table.add_value("crms_mean", found.crms_mean);
    table.add_value("accuracy_rms", accuracy);
    table.add_value("completeness_rms", completeness);
    table.add_value("completeness_seen_rms", seen);
    let text = format!("{:.2} mm", found.aligned.hausdorff);
    table.add("Hausdorff", text, "hausdorff", found.aligned.hausdorff);
}

fn add_times(table: &mut ResultTable, report: &Map<String, Value>) {
    let (wall, simulated) = (number(report, "wall_seconds"), number(report, "simulated_seconds"));
    let stages = report.get("stage_seconds").and_then(Value::as_object);
    let parts: Vec<String> = STAGE_NAMES
        .iter()
        .filter_map(|stage| Some(format!("{stage} {:.1}", stages?.get(*stage)?.as_f64()?)))
        .collect();
    let text = format!("{wall:.0} s ({}); the robot's clock: {simulated:.0} s", parts.join(", "));
    table.add("time", text, "wall_seconds", wall);
    table.add_value("simulated_seconds", simulated);
    table.add_value("stage_seconds", stages.cloned().unwrap_or_default());
}
