//! `puffer simulate`: a scan folder of an object, and apart from it the truth.

use crate::exit_status::usage_error;
use crate::progress::TerminalProgress;
use crate::table::ResultTable;
use anyhow::{Context, Result};
use clap::Args;
use puffer_core::geometry::{Cloud, Surface, Vec3, transform};
use puffer_core::mesh::Mesh;
use puffer_core::mesh::io::{Unit, read_mesh, write_cloud, write_mesh};
use puffer_core::params::ParamValue;
use puffer_core::scan::{SensorKind, Support};
use puffer_core::scan_files::{ScanSet, ScanSource, View, write_poses, write_scans};
use puffer_core::simulate::{NoiseFamily, SimulateParams, SimulatedScans, objects, simulate};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Scans with noise, outliers, drop-outs, occlusion and pose error; the truth goes to DIR.truth.
#[derive(Args)]
pub struct SimulateCommand {
    /// Object by name (`puffer objects` lists them), or a closed mesh file in metres
    #[arg(long)]
    object: String,
    /// Set-up: kr16_laser or omnirob_stereo
    #[arg(long, default_value = "kr16_laser")]
    setup: String,
    /// Noise family P1, P2K, P2 or P3 [default: that of the set-up]
    #[arg(long, value_name = "FAMILY")]
    noise: Option<String>,
    /// Number of views, spread evenly over all directions
    #[arg(long, default_value_t = SimulateParams::default().views)]
    views: usize,
    /// Scan folder to write
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Seed of all chance
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

impl SimulateCommand {
    pub(super) fn run(&self) -> Result<()> {
        let mut params = SimulateParams { family: self.family()?, ..SimulateParams::default() };
        params.set("views", &Value::from(self.views))?;
        let truth = load_object(&self.object)?;
        let watch = TerminalProgress::start();
        let scans = simulate(&truth, &params, self.seed, watch.progress())?;
        let times = watch.finish();
        let truth_dir = write_simulated_scans(&self.output, &truth, &scans)?;
        let mut report = ResultTable::default();
        let points: usize = scans.views.iter().map(|v| v.scan.returns().count()).sum();
        report.add("views", scans.views.len().to_string(), "views", scans.views.len());
        report.add("points", points.to_string(), "points", points);
        report.add("noise", format!("{:?}", scans.family), "noise", scans.family.to_value());
        report.add(
            "scans",
            self.output.display().to_string(),
            "scans",
            self.output.display().to_string(),
        );
        report.add(
            "truth",
            truth_dir.display().to_string(),
            "truth",
            truth_dir.display().to_string(),
        );
        let seconds: f64 = times.iter().map(|(_, time)| time.as_secs_f64()).sum();
        report.add("time", format!("{seconds:.1} s"), "seconds", seconds);
        report.print(self.json);
        Ok(())
    }

    fn family(&self) -> Result<NoiseFamily> {
        let of_setup =
            NoiseFamily::from_setup(&self.setup).map_err(|error| usage_error(error.to_string()))?;
        let Some(word) = &self.noise else { return Ok(of_setup) };
        NoiseFamily::from_value(&Value::from(word.as_str())).ok_or_else(|| {
            usage_error(format!("--noise {word}: there is {}", NoiseFamily::CHOICES.join(", ")))
        })
    }
}

/// The object of this name, or the closed mesh (metres) in this file.
///
/// # Errors
/// No such object or file, or a mesh that is not closed.
pub fn load_object(object: &str) -> Result<Mesh> {
    let path = Path::new(object);
    if path.extension().is_none() && !path.exists() {
        return Ok(objects::make_object(object)?);
    }
    let mesh = read_mesh(path)?;
    objects::check_ground_truth(&mesh).with_context(|| object.to_owned())?;
    Ok(mesh)
}

/// Writes the scan folder `dir` and, beside it, `dir.truth`, whose path is returned.
///
/// # Errors
/// A folder that cannot be written.
pub fn write_simulated_scans(dir: &Path, truth: &Mesh, scans: &SimulatedScans) -> Result<PathBuf> {
    let truth_dir = truth_dir(dir)?;
    for folder in [dir, &truth_dir] {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot create {}", folder.display()))?;
    }
    write(dir, &truth_dir, truth, scans)?;
    Ok(truth_dir)
}

/// `DIR.truth`, beside `DIR`.
fn truth_dir(dir: &Path) -> Result<PathBuf> {
    let name = dir.file_name().ok_or_else(|| {
        usage_error(format!("-o {}: give a folder with a name of its own", dir.display()))
    })?;
    let mut name = name.to_os_string();
    name.push(".truth");
    Ok(dir.with_file_name(name))
}

fn write(dir: &Path, truth_dir: &Path, truth: &Mesh, scans: &SimulatedScans) -> Result<()> {
    let sensor = if scans.family.is_stereo() { SensorKind::Stereo } else { SensorKind::Laser };
    let views = scans.views.iter().enumerate().map(|(i, view)| View {
        name: format!("view_{i:03}"),
        scan: view.scan.clone(),
        object_from_sensor: view.reported_pose,
    });
    let set = ScanSet {
        views: views.collect(),
        sensor: Some(sensor),
        pose_sigma: Some(scans.pose_sigma),
        support: Support::None,
        nominal: Value::Null,
    };
    write_scans(dir, &set, &[])?;
    let true_poses: Vec<_> = scans.views.iter().map(|v| v.true_pose).collect();
    let written = ScanSource::open(dir, Unit::Metre)?;
    write_poses(&truth_dir.join("poses.json"), &written, &true_poses, &[])?;
    write_mesh(&truth_dir.join("truth.ply"), truth, &[])?;
    write_cloud(&truth_dir.join("seen.ply"), &seen_points(truth, scans)?, &[])?;
    Ok(())
}

/// The points of the truth that the scans saw, with the truth's normals, object frame.
fn seen_points(truth: &Mesh, scans: &SimulatedScans) -> Result<Cloud> {
    let surface = Surface::new(&truth.vertices, &truth.triangles)?;
    let mut cloud = Cloud::default();
    for view in &scans.views {
        for i in view.scan.returns() {
            let hit = Vec3::from(view.hits[i].map(f64::from));
            if hit.iter().all(|v| v.is_finite()) {
                let point = transform(&view.true_pose, &hit);
                let normal = truth.triangle_normal(surface.project(&point).triangle);
                cloud.push(point, normal, f64::NAN, 1);
            }
        }
    }
    Ok(cloud)
}
