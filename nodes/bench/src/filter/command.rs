//! The command: each object, noise family, share of outliers and seed in turn.

use super::case::FilterCase;
use super::row::{FilterRow, heading, worst_row};
use crate::simulated_input::{parse_noise_family, prepare_scans};
use anyhow::Result;
use clap::Args;
use puffer::commands::simulate::load_object;
use puffer::parameters::ParameterArgs;
use puffer::table::print_text;
use puffer_core::Progress;
use puffer_core::assess::filter_figures;
use puffer_core::filter::{FilterParams, filter};
use puffer_core::geometry::Pose;
use puffer_core::mesh::Mesh;
use puffer_core::scan::PreparedScan;
use puffer_core::simulate::{
    NoiseFamily, SimulateParams, SimulatedScans, add_outliers, outlier_share, simulate,
};
use std::path::Path;
use std::time::Instant;

/// Filters simulated scans at their true poses and measures the cloud against the truth, over
/// several seeds.
#[derive(Args)]
pub(crate) struct FilterBenchmark {
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

impl FilterBenchmark {
    pub(crate) fn run(&self) -> Result<()> {
        let params = self.parameters.load()?.filter;
        let families: Vec<NoiseFamily> =
            self.noise.iter().map(|word| parse_noise_family(word)).collect::<Result<_>>()?;
        if !self.json {
            print_text(&heading());
        }
        for object in &self.objects {
            let truth = load_object(object)?;
            let name = Path::new(object).file_stem().unwrap_or_default().to_string_lossy();
            for &family in &families {
                for &outliers in &self.outliers {
                    let mut rows = Vec::new();
                    for &seed in &self.seeds {
                        let case = FilterCase { object: name.to_string(), family, outliers, seed };
                        rows.push(self.measure(case, &truth, &params)?);
                    }
                    if !self.json && rows.len() > 1 {
                        print_text(&worst_row(&rows));
                    }
                }
            }
        }
        Ok(())
    }

    /// Simulates and filters the scans of a case, and prints its row.
    fn measure(&self, case: FilterCase, truth: &Mesh, params: &FilterParams) -> Result<FilterRow> {
        let simulation =
            SimulateParams { family: case.family, views: self.views, ..Default::default() };
        let mut scans = simulate(truth, &simulation, case.seed, &Progress::silent())?;
        let own = outlier_share(case.family);
        // Share of the measurements that are no outliers yet, so that the whole share is that of
        // the case.
        let added = ((case.outliers - own) / (1.0 - own)).max(0.0);
        add_outliers(&mut scans, added, truth.aabb().diagonal() / 2.0, case.seed);
        let row = filter_case(case, truth, &scans, params)?;
        print_text(&if self.json { format!("{}\n", row.json()?) } else { row.line() });
        Ok(row)
    }
}

/// Filters the scans at their true poses and measures the cloud.
fn filter_case(
    case: FilterCase,
    truth: &Mesh,
    scans: &SimulatedScans,
    params: &FilterParams,
) -> Result<FilterRow> {
    let prepared = prepare_scans(scans)?;
    let posed: Vec<(&PreparedScan, Pose)> =
        prepared.iter().zip(&scans.views).map(|(scan, view)| (scan, view.true_pose)).collect();
    let started = Instant::now();
    let filtered = filter(&posed, None, params, &Progress::silent())?;
    let seconds = started.elapsed().as_secs_f64();
    let figures = filter_figures(truth, scans, &filtered, &Progress::silent())?;
    Ok(FilterRow { case, figures, seconds, noise_radius_mm: filtered.noise_radius * 1e3 })
}
