//! `puffer model`: models an object from the first view to the mesh, over DDS.

use crate::modelling_run::{ModellingRun, RunConfig};
use crate::setups::{self, Setting};
use anyhow::Result;
use clap::Args;
use serde_json::Value;
use std::path::PathBuf;

/// Starts the simulated robot and every node as processes of their own, models an object, and
/// writes the run folder: mesh, scans, bag, report, pictures.
#[derive(Args)]
pub struct ModelCommand {
    /// Set-up: kr16_laser or omnirob_stereo
    #[arg(long, default_value = "kr16_laser")]
    setup: String,
    /// Object by name (`puffer objects` lists them), or a closed mesh file in metres
    #[arg(long, default_value = "coffee")]
    object: String,
    /// Run folder [default: runs/SETUP-OBJECT, with a number if there is one already]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Scans taken at most [default: as configured]
    #[arg(long, value_name = "N")]
    max_scans: Option<usize>,
    /// End when this share of the known surface holds its measurements
    #[arg(long, value_name = "SHARE")]
    coverage: Option<f64>,
    /// All nodes in this process instead of one each
    #[arg(long)]
    one_process: bool,
    /// Seed of all chance
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Seconds that the simulated robot moves in one second
    #[arg(long, value_name = "FACTOR")]
    speed_up: Option<f64>,
    /// Sets a parameter of a node, as in --set nbv_planner:view.voxel_edge=0.003; may be repeated
    #[arg(long = "set", value_name = "NODE:NAME=VALUE")]
    settings: Vec<String>,
    /// DDS domain, 0 to 232 [default: a free one]
    #[arg(long, value_parser = clap::value_parser!(u16).range(0..=232))]
    domain: Option<u16>,
    /// Record no bag
    #[arg(long)]
    no_bag: bool,
    /// Write the mesh also where fewer than half of the scans are accepted, or less than half of
    /// the measured surface is explained by it
    #[arg(long)]
    force: bool,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

impl ModelCommand {
    pub(super) fn run(&self) -> Result<()> {
        let settings = self.all_settings()?;
        setups::check_settings(&settings)?;
        let config = RunConfig {
            setup: self.setup.clone(),
            object: self.object.clone(),
            out: self.out.clone(),
            settings,
            one_process: self.one_process,
            domain: self.domain,
            bag: !self.no_bag,
            force: self.force,
        };
        ModellingRun::new(config)?.model(self.json)
    }

    /// Those of the set-up, overridden by the options, overridden by `--set`.
    fn all_settings(&self) -> Result<Vec<Setting>> {
        let options: [(&str, &str, Option<Value>); 6] = [
            ("mock_driver", "driver.object", Some(self.object.as_str().into())),
            ("mock_driver", "driver.seed", Some(self.seed.into())),
            ("mesh_reconstructor", "mesh.seed", Some(self.seed.into())),
            ("mock_driver", "driver.speed_up", self.speed_up.map(Value::from)),
            ("modeller", "session.max_scans", self.max_scans.map(Value::from)),
            ("modeller", "session.coverage", self.coverage.map(Value::from)),
        ];
        let mut settings = setups::setup_settings(&self.setup)?;
        settings.extend(options.into_iter().filter_map(|(node, name, value)| {
            Some(Setting { node, name: name.into(), value: value? })
        }));
        for text in &self.settings {
            settings.push(setups::parse_setting(text)?);
        }
        Ok(settings)
    }
}
