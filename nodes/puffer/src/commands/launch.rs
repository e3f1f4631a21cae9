//! `puffer launch`: the nodes on the user's DDS domain, until Ctrl-C.

use crate::exit_status::usage_error;
use crate::launcher::{LaunchConfig, RunningNodes};
use crate::modelling_run::check_object;
use crate::nodes::NODES;
use crate::setups::{self, Setting, parameter_file};
use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use puffer_core::Error;
use puffer_ros::{RosArgs, Stop};
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

/// How long the runtime may take to end.
const SHUTDOWN_DEADLINE: Duration = Duration::from_secs(1);

/// Starts the nodes on DDS domain ROS_DOMAIN_ID, for play or for a real robot; Ctrl-C stops all.
///
/// With the mock driver, time comes from it; without, from the system's clock, and robot and sensor
/// are yours: /tf, joint_states, robot_description, points, trigger_scan and
/// follow_joint_trajectory.
#[derive(Args)]
pub struct LaunchCommand {
    /// Set-up: kr16_laser or omnirob_stereo
    #[arg(long)]
    setup: String,
    /// Who moves and scans
    #[arg(long, default_value = "mock")]
    driver: Driver,
    /// Object before the mock driver's sensor: a name (`puffer objects`), or a closed mesh file in
    /// metres
    #[arg(long, value_name = "OBJECT")]
    object: Option<String>,
    /// ROS parameter file on top of the set-up's (`puffer params --setup NAME --yaml` writes one)
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Folder for scans, report and mesh [default: the mesh goes to the current folder, nothing
    /// else is written]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum, PartialEq)]
enum Driver {
    /// The simulated robot
    Mock,
    /// A driver of yours
    None,
}

impl LaunchCommand {
    pub(super) fn run(&self) -> Result<()> {
        let mock = self.driver == Driver::Mock;
        let settings = self.settings()?;
        let args =
            RosArgs::parse(self.ros_args(mock)?).map_err(|e| usage_error(format!("{e:#}")))?;
        let mut file = tempfile::Builder::new()
            .prefix("puffer-")
            .suffix(".yaml")
            .tempfile()
            .context("cannot write a temporary parameter file")?;
        file.write_all(parameter_file(&NODES, &settings, Some(mock)).as_bytes())
            .with_context(|| format!("cannot write {}", file.path().display()))?;
        let config = LaunchConfig {
            nodes: NODES.iter().filter(|node| mock || node.name != "mock_driver").collect(),
            domain: args.domain(),
            params: file.path().to_path_buf(),
            more_args: self.ros_args(mock)?[1..].to_vec(),
            log: None,
        };
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
        let ended = runtime.block_on(run_until_exit(&config));
        runtime.shutdown_timeout(SHUTDOWN_DEADLINE);
        ended
    }

    /// What is not at its default.
    fn settings(&self) -> Result<Vec<Setting>> {
        let mut settings = setups::setup_settings(&self.setup)?;
        if let Some(object) = &self.object {
            if self.driver == Driver::None {
                return Err(usage_error(
                    "--object is for the mock driver; leave it or --driver none out",
                ));
            }
            check_object(object)?;
            settings.push(Setting {
                node: "mock_driver",
                name: "driver.object".into(),
                value: object.as_str().into(),
            });
        }
        if let Some(out) = &self.out {
            std::fs::create_dir_all(out)
                .with_context(|| format!("cannot create the folder {}", out.display()))?;
            let folder = out.canonicalize()?.display().to_string();
            settings.extend(setups::output_settings(&folder));
        }
        Ok(settings)
    }

    /// What every node gets beside the set-up's file; the last word on where time comes from is not
    /// the user's file's.
    fn ros_args(&self, mock: bool) -> Result<Vec<String>> {
        let mut args = vec!["--ros-args".to_owned()];
        if let Some(path) = &self.params {
            let path = path.to_str().context("the parameter file's path is not UTF-8")?;
            args.extend(["--params-file".to_owned(), path.to_owned()]);
        }
        args.extend(["-p".to_owned(), format!("use_sim_time:={mock}")]);
        Ok(args)
    }
}

/// Starts the nodes and waits for Ctrl-C, or for the first that ends by itself.
async fn run_until_exit(config: &LaunchConfig) -> Result<()> {
    let stop = Stop::on_signals()?;
    let mut nodes = RunningNodes::start(config, false)?;
    eprintln!("nodes on DDS domain {}; Ctrl-C stops them:", config.domain);
    for (name, id) in nodes.process_ids() {
        eprintln!("  {name:<20}{id:>8}");
    }
    let lost = stop.or(nodes.wait_for_exit()).await;
    if lost.is_none() {
        eprintln!("puffer: interrupted, stopping");
    }
    let problems = nodes.stop().await;
    match lost {
        Some(why) => bail!("{why}; all other nodes were stopped"),
        None if problems.is_empty() => Err(Error::Cancelled.into()),
        None => bail!("{}", problems.join("; ")),
    }
}
