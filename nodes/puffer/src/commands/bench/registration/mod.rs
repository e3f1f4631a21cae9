//! `puffer bench registration`: how far registered poses are from the truth, on simulated scans.

mod found;
mod growth;
mod returned;
mod row;
mod verdicts;

use super::family;
use crate::commands::simulate::{truth_of, write_folder};
use crate::parameters::ParameterArgs;
use crate::table::print_text;
use anyhow::{Context, Result};
use clap::Args;
use found::{Found, Prepared};
use puffer_core::Progress;
use puffer_core::mesh::Mesh;
use puffer_core::register::{RegisterParams, Variant, variants};
use puffer_core::simulate::{NoiseFamily, SimulateParams, SimulatedScans, simulate};
use row::{heading, measure, variants_heading, worst};
use serde_json::json;
use std::path::{Path, PathBuf};

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
    /// Measures the poses in CASE.NAME.json beside the folders kept, instead of registering: another program's
    #[arg(long, value_name = "NAME", requires = "keep")]
    judge: Option<String>,
    /// Compares the variants of ICP: one row each for what the parameters say, and for every other word of each choice
    #[arg(long, conflicts_with_all = ["keep", "one_by_one"])]
    variants: bool,
    /// Measures how long scans take that come one by one, the more of them there are; try it with --views 100
    #[arg(long, conflicts_with = "keep")]
    one_by_one: bool,
    /// Instead: N trials of verdicts on pairs of scans, with each object and noise family
    #[arg(long, value_name = "N", conflicts_with_all = ["keep", "json", "variants", "one_by_one"])]
    verdicts: Option<usize>,
    /// Instead: whether the scans of a folder or *.conf file, moved off their poses, come back to them
    #[arg(long, value_name = "INPUT", conflicts_with_all = ["keep", "json", "variants", "one_by_one", "verdicts"])]
    returned: Option<PathBuf>,
    #[command(flatten)]
    parameters: ParameterArgs,
    /// Print a JSON object a case instead of a table
    #[arg(long)]
    json: bool,
}

/// What is registered.
#[derive(Clone)]
struct Case {
    object: String,
    family: NoiseFamily,
    seed: u64,
}

impl Case {
    fn name(&self) -> String {
        format!("{}_{:?}_{}", self.object, self.family, self.seed)
    }
}

impl Registration {
    pub(super) fn run(&self) -> Result<()> {
        let params = self.parameters.load()?.register;
        if let Some(input) = &self.returned {
            return returned::run(input, &self.seeds, &params);
        }
        if let Some(count) = self.verdicts {
            let seed = self.seeds.first().copied().unwrap_or(1);
            let size = (self.views, count, seed);
            return verdicts::run(&self.objects, &self.noise, size, &params);
        }
        let families: Vec<NoiseFamily> =
            self.noise.iter().map(|word| family(word)).collect::<Result<_>>()?;
        let several = self.variants || self.one_by_one;
        if !self.json && !several {
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
                    let case = Case { object: name.to_string(), family, seed };
                    if several {
                        self.compare(&case, &truth, &scans, &params)?;
                        continue;
                    }
                    let found = self.register(&case, &truth, &scans, &params)?;
                    let row = measure(case, &truth, &scans, found)?;
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

    /// One table about one case.
    fn compare(
        &self,
        case: &Case,
        truth: &Mesh,
        scans: &SimulatedScans,
        params: &RegisterParams,
    ) -> Result<()> {
        let prepared = Prepared::new(scans).with_context(|| case.name())?;
        if self.one_by_one {
            let growth = growth::measure(scans, &prepared, params);
            print_text(&if self.json {
                format!("{}\n", growth.json(case))
            } else {
                growth.table(case)
            });
            return Ok(());
        }
        if !self.json {
            print_text(&variants_heading(case));
        }
        let default = Variant { name: "default".to_owned(), params: params.clone() };
        for Variant { name, params } in std::iter::once(default).chain(variants(params)) {
            let found = Found::ours(scans, &prepared, &params).with_context(|| name.clone())?;
            let row = measure(case.clone(), truth, scans, found)?;
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

    fn register(
        &self,
        case: &Case,
        truth: &Mesh,
        scans: &SimulatedScans,
        params: &RegisterParams,
    ) -> Result<Found> {
        if let (Some(name), Some(folder)) = (&self.judge, &self.keep) {
            return Found::foreign(&folder.join(format!("{}.{name}.json", case.name())), scans);
        }
        if let Some(folder) = &self.keep {
            write_folder(&folder.join(case.name()), truth, scans)?;
        }
        let prepared = Prepared::new(scans).with_context(|| case.name())?;
        Found::ours(scans, &prepared, params).with_context(|| case.name())
    }
}
