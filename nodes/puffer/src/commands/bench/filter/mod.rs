//! `puffer bench filter`: how good the filtered cloud is, on simulated scans at their true poses.

mod row;

use super::{family, prepared};
use crate::commands::simulate::truth_of;
use crate::parameters::ParameterArgs;
use crate::table::print_text;
use anyhow::Result;
use clap::Args;
use puffer_core::Progress;
use puffer_core::assess::filter_figures;
use puffer_core::filter::{FilterParams, filter};
use puffer_core::geometry::Pose;
use puffer_core::mesh::Mesh;
use puffer_core::register::PreparedScan;
use puffer_core::simulate::{
    NoiseFamily, SimulateParams, SimulatedScans, add_outliers, outlier_share, simulate,
};
use row::{Row, heading, worst};
use std::path::Path;
use std::time::Instant;

/// Filters simulated scans at their true poses and measures the cloud against the truth, over several seeds.
#[derive(Args)]
pub struct Filter {
    /// Objects by name, or closed mesh files in metres
    #[arg(long, value_delimiter = ',', default_value = "filter,coffee,mug")]
    objects: Vec<String>,
    /// Noise families
    #[arg(long, value_delimiter = ',', default_value = "P1,P3")]
    noise: Vec<String>,
    /// Shares of outliers; what the sensor has of its own is filled up
    #[arg(long, value_delimiter = ',', default_value = "0.01,0.1")]
    outliers: Vec<f64>,
    /// Seeds
    #[arg(long, value_delimiter = ',', default_value = "1,2,3,4,5")]
    seeds: Vec<u64>,
    /// Views of each object
    #[arg(long, default_value_t = SimulateParams::default().views)]
    views: usize,
    #[command(flatten)]
    parameters: ParameterArgs,
    /// Print a JSON object a case instead of a table
    #[arg(long)]
    json: bool,
}

/// What is filtered.
#[derive(Clone)]
struct Case {
    object: String,
    family: NoiseFamily,
    outliers: f64,
    seed: u64,
}

impl Filter {
    pub(super) fn run(&self) -> Result<()> {
        let params = self.parameters.load()?.filter;
        let families: Vec<NoiseFamily> =
            self.noise.iter().map(|word| family(word)).collect::<Result<_>>()?;
        if !self.json {
            print_text(&heading());
        }
        for object in &self.objects {
            let truth = truth_of(object)?;
            let name = Path::new(object).file_stem().unwrap_or_default().to_string_lossy();
            for &family in &families {
                for &outliers in &self.outliers {
                    let case = |&seed: &u64| {
                        let case = Case { object: name.to_string(), family, outliers, seed };
                        self.measure(case, &truth, &params)
                    };
                    let rows: Vec<Row> = self.seeds.iter().map(case).collect::<Result<_>>()?;
                    if !self.json && rows.len() > 1 {
                        print_text(&worst(&rows));
                    }
                }
            }
        }
        Ok(())
    }

    fn measure(&self, case: Case, truth: &Mesh, params: &FilterParams) -> Result<Row> {
        let of = SimulateParams { family: case.family, views: self.views, ..Default::default() };
        let mut scans = simulate(truth, &of, case.seed, &Progress::silent())?;
        let own = outlier_share(case.family);
        // Of those that are left, so that the whole share is as asked for.
        let more = ((case.outliers - own) / (1.0 - own)).max(0.0);
        add_outliers(&mut scans, more, truth.aabb().diagonal() / 2.0, case.seed);
        let row = filtered(case, truth, &scans, params)?;
        print_text(&if self.json { format!("{}\n", row.json()?) } else { row.line() });
        Ok(row)
    }
}

fn filtered(
    case: Case,
    truth: &Mesh,
    scans: &SimulatedScans,
    params: &FilterParams,
) -> Result<Row> {
    let prepared = prepared(scans)?;
    let posed: Vec<(&PreparedScan, Pose)> =
        prepared.iter().zip(&scans.views).map(|(scan, view)| (scan, view.true_pose)).collect();
    let started = Instant::now();
    let filtered = filter(&posed, f64::NAN, params, &Progress::silent())?;
    let seconds = started.elapsed().as_secs_f64();
    let figures = filter_figures(truth, scans, &filtered, &Progress::silent())?;
    Ok(Row { case, figures, seconds, noise_radius: filtered.noise_radius * 1e3 })
}
