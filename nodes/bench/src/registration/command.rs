//! The command: each object, noise family and seed in turn.

use super::case::RegistrationCase;
use super::insertion_times::InsertionTimes;
use super::outcome::{PreparedScans, RegistrationOutcome};
use super::pair_trials::{self, TrialSeries};
use super::recovery;
use super::row::{RegistrationRow, heading, variants_heading, worst_row};
use crate::simulated_input::parse_noise_family;
use anyhow::{Context, Result};
use clap::Args;
use puffer::commands::simulate::{load_object, write_simulated_scans};
use puffer::parameters::ParameterArgs;
use puffer::table::print_text;
use puffer_core::Progress;
use puffer_core::mesh::Mesh;
use puffer_core::register::{IcpVariant, RegisterParams, icp_variants};
use puffer_core::simulate::{NoiseFamily, SimulateParams, SimulatedScans, simulate};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Registers simulated scans and measures the poses against the true ones, over several seeds.
#[derive(Args)]
pub(crate) struct RegistrationBenchmark {
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
    /// Measures the poses in CASE.NAME.json beside the folders kept, instead of registering:
    /// another program's
    #[arg(long, value_name = "NAME", requires = "keep")]
    judge: Option<String>,
    /// Compares the variants of ICP: one row each for what the parameters say, and for every other
    /// word of each choice
    #[arg(long, conflicts_with_all = ["keep", "one_by_one"])]
    variants: bool,
    /// Measures how long scans take that come one by one, the more of them there are; try it with
    /// --views 100
    #[arg(long, conflicts_with = "keep")]
    one_by_one: bool,
    /// Instead: N trials of verdicts on pairs of scans, with each object and noise family
    #[arg(long, value_name = "N", conflicts_with_all = ["keep", "json", "variants", "one_by_one"])]
    verdicts: Option<usize>,
    /// Instead: whether the scans of a folder or *.conf file, moved off their poses, come back to
    /// them
    #[arg(long, value_name = "INPUT", conflicts_with_all = ["keep", "json", "variants", "one_by_one", "verdicts"])]
    returned: Option<PathBuf>,
    #[command(flatten)]
    parameters: ParameterArgs,
    /// Print a JSON object a case instead of a table
    #[arg(long)]
    json: bool,
}

impl RegistrationBenchmark {
    pub(crate) fn run(&self) -> Result<()> {
        let params = self.parameters.load()?.register;
        if let Some(input) = &self.returned {
            return recovery::run(input, &self.seeds, &params);
        }
        if let Some(count) = self.verdicts {
            let seed = self.seeds.first().copied().unwrap_or(1);
            let series = TrialSeries { views: self.views, count, seed };
            return pair_trials::run(&self.objects, &self.noise, &series, &params);
        }
        let families: Vec<NoiseFamily> =
            self.noise.iter().map(|word| parse_noise_family(word)).collect::<Result<_>>()?;
        let tables = self.variants || self.one_by_one;
        if !self.json && !tables {
            print_text(&heading());
        }
        for object in &self.objects {
            let truth = load_object(object)?;
            let name = Path::new(object).file_stem().unwrap_or_default().to_string_lossy();
            for &family in &families {
                let mut rows = Vec::new();
                for &seed in &self.seeds {
                    let simulation =
                        SimulateParams { family, views: self.views, ..Default::default() };
                    let scans = simulate(&truth, &simulation, seed, &Progress::silent())?;
                    let case = RegistrationCase { object: name.to_string(), family, seed };
                    if tables {
                        self.print_table(&case, &truth, &scans, &params)?;
                        continue;
                    }
                    let outcome = self.register(&case, &truth, &scans, &params)?;
                    let row = RegistrationRow::measure(case, &truth, &scans, outcome)?;
                    print_text(&if self.json { format!("{}\n", row.json()) } else { row.line() });
                    rows.push(row);
                }
                if !self.json && rows.len() > 1 {
                    print_text(&worst_row(&rows));
                }
            }
        }
        Ok(())
    }

    /// Prints a table about one case: its variants or its insertion times.
    fn print_table(
        &self,
        case: &RegistrationCase,
        truth: &Mesh,
        scans: &SimulatedScans,
        params: &RegisterParams,
    ) -> Result<()> {
        let prepared = PreparedScans::new(scans).with_context(|| case.name())?;
        if self.one_by_one {
            let times = InsertionTimes::measure(scans, &prepared, params);
            print_text(&if self.json {
                format!("{}\n", times.json(case))
            } else {
                times.table(case)
            });
            return Ok(());
        }
        if !self.json {
            print_text(&variants_heading(case));
        }
        let default = IcpVariant { name: "default".to_owned(), params: params.clone() };
        for IcpVariant { name, params } in std::iter::once(default).chain(icp_variants(params)) {
            let outcome = RegistrationOutcome::measure(scans, &prepared, &params)
                .with_context(|| name.clone())?;
            let row = RegistrationRow::measure(case.clone(), truth, scans, outcome)?;
            if self.json {
                let mut value = row.json();
                value["variant"] = json!(name);
                print_text(&format!("{value}\n"));
            } else {
                print_text(&row.variant_line(&name));
            }
        }
        Ok(())
    }

    /// Registers the scans of a case, or reads what another program made of them.
    fn register(
        &self,
        case: &RegistrationCase,
        truth: &Mesh,
        scans: &SimulatedScans,
        params: &RegisterParams,
    ) -> Result<RegistrationOutcome> {
        if let (Some(name), Some(folder)) = (&self.judge, &self.keep) {
            return RegistrationOutcome::read(
                &folder.join(format!("{}.{name}.json", case.name())),
                scans,
            );
        }
        if let Some(folder) = &self.keep {
            write_simulated_scans(&folder.join(case.name()), truth, scans)?;
        }
        let prepared = PreparedScans::new(scans).with_context(|| case.name())?;
        RegistrationOutcome::measure(scans, &prepared, params).with_context(|| case.name())
    }
}
