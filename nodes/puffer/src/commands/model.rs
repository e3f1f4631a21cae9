//! `puffer model`: models an object from the first view to the mesh, over DDS.

use crate::run::{Plan, Run};
use crate::setups;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Starts the simulated robot and every node as processes of their own, models an object, and writes the run folder:
/// mesh, scans, bag, report, pictures.
#[derive(Args)]
pub struct Model {
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
    /// Write the mesh also where fewer than half of the scans are accepted, or less than half of the
    /// measured surface is explained by it
    #[arg(long)]
    force: bool,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

impl Model {
    pub(super) fn run(&self) -> Result<()> {
        let mut settings = setups::of(&self.setup)?;
        let mut set = |node, name: &'static str, value: serde_json::Value| {
            settings.push(setups::Setting { node, name: name.into(), value });
        };
        set("mock_driver", "driver.object", self.object.as_str().into());
        set("mock_driver", "driver.seed", self.seed.into());
        set("mesh_reconstructor", "mesh.seed", self.seed.into());
        if let Some(speed_up) = self.speed_up {
            set("mock_driver", "driver.speed_up", speed_up.into());
        }
        if let Some(scans) = self.max_scans {
            set("modeller", "session.max_scans", scans.into());
        }
        if let Some(coverage) = self.coverage {
            set("modeller", "session.coverage", coverage.into());
        }
        settings.extend(
            self.settings.iter().map(|text| setups::parse(text)).collect::<Result<Vec<_>>>()?,
        );
        setups::check(&settings)?;
        let plan = Plan {
            setup: self.setup.clone(),
            object: self.object.clone(),
            out: self.out.clone(),
            settings,
            one_process: self.one_process,
            domain: self.domain,
            bag: !self.no_bag,
            force: self.force,
        };
        Run::new(plan)?.model(self.json)
    }
}
