//! What is made of a finished run: figures against the truth, pictures, the report.

use super::run_folder::RunFolder;
use crate::png_file::write_png;
use anyhow::{Context, Result};
use puffer_core::Progress;
use puffer_core::assess::{AssessParams, Assessment, assess};
use puffer_core::mesh::Mesh;
use puffer_core::mesh::io::{read_cloud, read_mesh, write_mesh};
use puffer_core::mesh::render::render_sheet;
use serde_json::{Map, Value, json};

/// Pixels of a picture.
const PICTURE_SIZE: (usize, usize) = (1200, 800);

/// Draws the mesh, writes it as GLB, and measures it if the truth is there.
pub(crate) fn write_results(folder: &RunFolder) -> Result<Option<Assessment>> {
    let mesh_file = folder.file("mesh.ply");
    if !mesh_file.is_file() {
        return Ok(None);
    }
    let mesh = read_mesh(&mesh_file)?;
    write_mesh(&folder.file("mesh.glb"), &mesh, &[])?;
    write_png(&folder.file("mesh.png"), &render_sheet(&mesh, PICTURE_SIZE.0, PICTURE_SIZE.1))?;
    assess_mesh(folder, &mesh)
}

fn assess_mesh(folder: &RunFolder, mesh: &Mesh) -> Result<Option<Assessment>> {
    let truth_file = folder.file("truth.ply");
    if !truth_file.is_file() {
        return Ok(None);
    }
    let truth = read_mesh(&truth_file)?;
    let seen_file = folder.file("seen.ply");
    let seen = if seen_file.is_file() { Some(read_cloud(&seen_file)?.points) } else { None };
    let params = AssessParams { seen, ..AssessParams::default() };
    Ok(Some(assess(mesh, &truth, &params, &Progress::silent())?))
}

/// Reads the modeller's report; empty if it left none.
pub(crate) fn read_report(folder: &RunFolder) -> Map<String, Value> {
    let text = std::fs::read(folder.file("report.json")).unwrap_or_default();
    serde_json::from_slice(&text).unwrap_or_default()
}

/// Writes the report again with `facts` added.
pub(crate) fn extend_report(folder: &RunFolder, facts: Map<String, Value>) -> Result<()> {
    let mut report = read_report(folder);
    report.extend(facts);
    let path = folder.file("report.json");
    std::fs::write(&path, format!("{:#}\n", Value::Object(report)))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// The figures for the report.
pub(crate) fn assessment_json(assessment: Option<&Assessment>) -> Value {
    assessment.map_or(Value::Null, |a| json!(a))
}
