//! `puffer bench registration`: how far registered poses are from the truth, on simulated scans.

use crate::commands::simulate::{truth_of, write_folder};
use crate::failure::usage;
use crate::parameters::ParameterArgs;
use crate::table::print_text;
use anyhow::{Context, Result};
use clap::Args;
use puffer_core::Progress;
use puffer_core::assess::{PoseErrors, PosedHits, pose_errors};
use puffer_core::geometry::{Pose, Vec3};
use puffer_core::mesh::Mesh;
use puffer_core::params::ParamValue;
use puffer_core::register::{PreparedScan, RegisterParams, Status, register};
use puffer_core::simulate::{NoiseFamily, SimulateParams, SimulatedScans, simulate};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Registers simulated scans and measures the poses against the true ones, over several seeds.
#[derive(Args)]
pub struct Registration {
    /// Objects by name, or closed mesh files in metres
    #[arg(long, value_delimiter = ',', default_value = "filter,coffee,mug")]
    objects: Vec<String>,
    /// Noise families
    #[arg(long, value_delimiter = ',', default_value = "P2K,P2,P3")]
    noise: Vec<String>,
    /// Seeds
    #[arg(long, value_delimiter = ',', default_value = "1,2,3,4,5")]
    seeds: Vec<u64>,
    /// Views of each object
    #[arg(long, default_value_t = SimulateParams::default().views)]
    views: usize,
    /// Also writes each case as a scan folder with its truth, for other programs to be measured on
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    #[command(flatten)]
    parameters: ParameterArgs,
    /// Print a JSON object a case instead of a table
    #[arg(long)]
    json: bool,
}

/// Hits of a case that are compared at most; more change no figure by a per cent.
const HITS: usize = 60_000;

/// What came out of one case.
struct Row {
    object: String,
    family: NoiseFamily,
    seed: u64,
    robot: PoseErrors,
    ours: PoseErrors,
    refused: usize,
    prepare: f64,
    register: f64,
}

impl Registration {
    pub(super) fn run(&self) -> Result<()> {
        let params = self.parameters.load()?.register;
        let families: Vec<NoiseFamily> =
            self.noise.iter().map(|word| family(word)).collect::<Result<_>>()?;
        if !self.json {
            print_text(&heading());
        }
        for object in &self.objects {
            let truth = truth_of(object)?;
            let name = Path::new(object).file_stem().unwrap_or_default().to_string_lossy();
            for &family in &families {
                let mut rows = Vec::new();
                for &seed in &self.seeds {
                    let of = SimulateParams { family, views: self.views, ..Default::default() };
                    let scans = simulate(&truth, &of, seed, &Progress::silent())?;
                    if let Some(folder) = &self.keep {
                        let folder = folder.join(format!("{name}_{family:?}_{seed}"));
                        write_folder(&folder, &truth, &scans)?;
                    }
                    let row = measure(&name, family, seed, &truth, &scans, &params)?;
                    print_text(&if self.json { format!("{}\n", row.json()) } else { row.line() });
                    rows.push(row);
                }
                if !self.json && rows.len() > 1 {
                    print_text(&worst(&rows));
                }
            }
        }
        Ok(())
    }
}

fn family(word: &str) -> Result<NoiseFamily> {
    NoiseFamily::from_value(&Value::from(word)).ok_or_else(|| {
        usage(format!("--noise {word}: there is {}", NoiseFamily::CHOICES.join(", ")))
    })
}

fn measure(
    object: &str,
    family: NoiseFamily,
    seed: u64,
    truth: &Mesh,
    scans: &SimulatedScans,
    params: &RegisterParams,
) -> Result<Row> {
    let started = Instant::now();
    let prepared: Vec<PreparedScan> = scans
        .views
        .iter()
        .enumerate()
        .map(|(i, v)| PreparedScan::new(&v.scan).with_context(|| format!("view {i} of {object}")))
        .collect::<Result<_>>()?;
    let prepare = started.elapsed().as_secs_f64();
    let robot: Vec<Pose> = scans.views.iter().map(|v| v.reported_pose).collect();
    let started = Instant::now();
    let found = register(&prepared, &robot, Some(scans.pose_sigma), params, &Progress::silent())?;
    let register = started.elapsed().as_secs_f64();
    let errors = |poses: &[Pose]| pose_errors(&posed(scans, poses), truth, &Progress::silent());
    let refused = found.verdicts.iter().filter(|v| v.status != Status::Accepted).count();
    Ok(Row {
        object: object.to_owned(),
        family,
        seed,
        robot: errors(&robot)?,
        ours: errors(&found.poses)?,
        refused,
        prepare,
        register,
    })
}

fn posed(scans: &SimulatedScans, poses: &[Pose]) -> Vec<PosedHits> {
    let all: usize = scans.views.iter().map(|v| v.scan.returns().count()).sum();
    let step = all.div_ceil(HITS).max(1);
    let hits = |hits: &[[f32; 3]]| -> Vec<Vec3> {
        let met = hits.iter().filter(|h| h[0].is_finite());
        met.step_by(step).map(|h| Vec3::from(h.map(f64::from))).collect()
    };
    let view = |(v, pose): (&puffer_core::simulate::SimulatedView, &Pose)| PosedHits {
        hits: hits(&v.hits),
        truth: v.true_pose,
        estimate: *pose,
    };
    scans.views.iter().zip(poses).map(view).collect()
}

fn heading() -> String {
    "errors in mm: along the normal, full, of the surface; in brackets the robot's own\n".to_owned()
}

fn figures(ours: &PoseErrors, robot: &PoseErrors) -> String {
    format!(
        "normal {:6.3} ({:5.2})  full {:6.3} ({:5.2})  surface {:6.3} ({:5.2})",
        ours.normal, robot.normal, ours.full, robot.full, ours.surface, robot.surface
    )
}

fn worst(rows: &[Row]) -> String {
    let largest = |of: fn(&Row) -> f64| rows.iter().map(of).fold(0.0, f64::max);
    let ours = PoseErrors {
        normal: largest(|r| r.ours.normal),
        full: largest(|r| r.ours.full),
        surface: largest(|r| r.ours.surface),
    };
    let robot = PoseErrors {
        normal: largest(|r| r.robot.normal),
        full: largest(|r| r.robot.full),
        surface: largest(|r| r.robot.surface),
    };
    let refused = rows.iter().map(|r| r.refused).max().unwrap_or(0);
    format!(
        "{:<12} {:<4} worst  {}  refused {refused}\n",
        rows[0].object,
        format!("{:?}", rows[0].family),
        figures(&ours, &robot)
    )
}

impl Row {
    fn line(&self) -> String {
        format!(
            "{:<12} {:<4} {:>5}  {}  refused {}  prepare {:.1} s, register {:.1} s\n",
            self.object,
            format!("{:?}", self.family),
            self.seed,
            figures(&self.ours, &self.robot),
            self.refused,
            self.prepare,
            self.register
        )
    }

    fn json(&self) -> Value {
        let errors =
            |e: &PoseErrors| json!({ "normal": e.normal, "full": e.full, "surface": e.surface });
        json!({
            "object": self.object, "noise": format!("{:?}", self.family), "seed": self.seed,
            "ours": errors(&self.ours), "robot": errors(&self.robot), "refused": self.refused,
            "prepare_seconds": self.prepare, "register_seconds": self.register,
        })
    }
}
