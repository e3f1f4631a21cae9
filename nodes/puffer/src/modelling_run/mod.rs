//! One modelling run over DDS, from start to report.

mod goal;
mod recorder;
mod results;
mod run_folder;
mod summary;

use crate::launcher::{LaunchConfig, RunningNodes};
use crate::nodes::NODES;
use crate::setups::{Setting, output_settings, parameter_file};
use crate::verdict_report;
use anyhow::{Context, Result, anyhow, bail};
use goal::{RunEnding, run_goal};
use puffer_core::Error;
use puffer_core::assess::Assessment;
use puffer_core::mesh::Mesh;
use puffer_core::verdict::ModelVerdict;
use puffer_msgs::action::ModelObjectGoal;
use puffer_ros::scans::PARAMETERS_METADATA_KEY;
use puffer_ros::{NoParams, Node, RosArgs, Stop, domain};
use recorder::RunRecorder;
use run_folder::RunFolder;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How long the runtime may take to end.
const SHUTDOWN_DEADLINE: Duration = Duration::from_secs(1);

/// A run as the user asks for it.
pub(crate) struct RunConfig {
    pub setup: String,
    /// A name, or the path of a mesh.
    pub object: String,
    /// The run folder; `None`: one is chosen.
    pub out: Option<PathBuf>,
    pub settings: Vec<Setting>,
    /// Whether all nodes are tasks of this process.
    pub one_process: bool,
    /// The DDS domain; `None`: a free one.
    pub domain: Option<u16>,
    /// Whether a bag is recorded.
    pub bag: bool,
    /// Whether a mesh is written that is not trustworthy.
    pub force: bool,
}

/// A run whose folder is made.
pub(crate) struct ModellingRun {
    config: RunConfig,
    folder: RunFolder,
    domain: u16,
}

impl ModellingRun {
    /// Makes the run folder, finds a domain and writes the parameter file.
    ///
    /// # Errors
    /// An object that cannot be simulated, a folder that is taken, or a domain in use.
    pub(crate) fn new(mut config: RunConfig) -> Result<ModellingRun> {
        check_object(&config.object)?;
        let domain = match config.domain {
            Some(domain) if !domain::is_free(domain) => {
                bail!(
                    "DDS domain {domain} is in use by another program: leave --domain out to get a free one"
                )
            }
            Some(domain) => domain,
            None => domain::find_free()?,
        };
        let stem = Path::new(&config.object)
            .file_stem()
            .map_or_else(String::new, |s| s.to_string_lossy().into());
        let folder = RunFolder::create(config.out.as_deref(), &format!("{}-{stem}", config.setup))?;
        config.settings.extend(output_settings(&folder.path().display().to_string()));
        let params = folder.file("params.yaml");
        std::fs::write(&params, parameter_file(&NODES, &config.settings, Some(true)))
            .with_context(|| format!("cannot write {}", params.display()))?;
        Ok(ModellingRun { config, folder, domain })
    }

    /// Runs it and prints the results.
    ///
    /// # Errors
    /// Whatever kept a mesh from being made; what was measured is in the run folder.
    pub(crate) fn model(self, json: bool) -> Result<()> {
        let since = Instant::now();
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
        let driven = runtime.block_on(self.run_nodes());
        runtime.shutdown_timeout(SHUTDOWN_DEADLINE);
        let (ending, problems) = driven?;
        for problem in &problems {
            eprintln!("puffer: {problem}");
        }
        let assessment = results::write_results(&self.folder)?;
        let facts = self.facts(&ending, assessment.as_ref(), since.elapsed());
        results::extend_report(&self.folder, facts)?;
        let report = results::read_report(&self.folder);
        match ending {
            RunEnding::Modelled => {
                summary::print_summary(&report, assessment.as_ref(), self.folder.path(), json);
                self.check_verdict(&report, true)
            }
            RunEnding::NotTrustworthy(why) => {
                summary::print_summary(&report, None, self.folder.path(), json);
                self.check_verdict(&report, false)?;
                Err(anyhow!(why))
            }
            RunEnding::Cancelled => {
                eprintln!(
                    "puffer: interrupted; what was measured is in {}",
                    self.folder.path().display()
                );
                Err(Error::Cancelled.into())
            }
            RunEnding::Failed(why) => {
                Err(anyhow!("{why}; what was measured is in {}", self.folder.path().display()))
            }
        }
    }

    /// Checks the verdict on the whole model, as a warning only if there is a mesh.
    fn check_verdict(&self, report: &Map<String, Value>, has_mesh: bool) -> Result<()> {
        let folder = self.folder.path().display();
        let how = format!(
            "what was measured is in {folder}, and puffer reconstruct {folder}/scans -o mesh.ply --force makes a mesh \
             of it all the same"
        );
        verdict_report::ensure_trustworthy(&ModelVerdict::from_json(report), has_mesh, &how)
    }

    /// Starts the nodes, sends the goal, waits for its end and stops the nodes; how the run ended,
    /// and what went wrong while the nodes were stopped.
    async fn run_nodes(&self) -> Result<(RunEnding, Vec<String>)> {
        let stop = Stop::on_signals()?;
        let config = LaunchConfig {
            nodes: NODES.iter().collect(),
            domain: self.domain,
            params: self.folder.file("params.yaml"),
            more_args: Vec::new(),
            log: Some(self.folder.file("log.txt")),
        };
        eprintln!("run folder {}", self.folder.path().display());
        // It starts before the nodes that publish.
        let recorder = if self.config.bag {
            Some(
                RunRecorder::start(self.domain, &self.folder.file("bag.mcap"), self.notes()?)
                    .await?,
            )
        } else {
            None
        };
        let mut nodes = RunningNodes::start(&config, self.config.one_process)?;
        let ids: Vec<String> =
            nodes.process_ids().iter().map(|(name, id)| format!("{name} {id}")).collect();
        eprintln!("nodes on DDS domain {}: {}", self.domain, ids.join(", "));
        let ending = tokio::select! {
            // However it ends, the nodes are stopped in order.
            ending = self.send_goal(&stop) => {
                ending.unwrap_or_else(|error| RunEnding::Failed(format!("{error:#}")))
            }
            why = nodes.wait_for_exit() => RunEnding::Failed(why),
        };
        let mut problems = nodes.stop().await;
        if let Some(recorder) = recorder {
            problems.extend(recorder.stop().await.err().map(|error| format!("{error:#}")));
        }
        Ok((ending, problems))
    }

    /// What the bag holds beside the messages.
    fn notes(&self) -> Result<BTreeMap<String, String>> {
        let seed = self.config.settings.iter().rev().find(|s| s.name == "driver.seed");
        let params = self.folder.file("params.yaml");
        let params = std::fs::read_to_string(&params)
            .with_context(|| format!("cannot read {}", params.display()))?;
        let notes = [
            (PARAMETERS_METADATA_KEY, params),
            ("program", format!("puffer {}", env!("CARGO_PKG_VERSION"))),
            ("setup", self.config.setup.clone()),
            ("object", self.config.object.clone()),
            ("seed", seed.map_or_else(String::new, |s| s.value.to_string())),
        ];
        Ok(notes.map(|(key, text)| (key.to_owned(), text)).into())
    }

    /// Sends the goal from a node of its own and waits for its end.
    async fn send_goal(&self, stop: &Stop) -> Result<RunEnding> {
        // The node has a stop of its own: Ctrl-C cancels the goal, and that needs the node.
        let args = RosArgs::parse(std::iter::empty())?.with_domain(self.domain);
        let node: Node<NoParams> = Node::start("puffer_model", args, Stop::new()).await?;
        let goal = ModelObjectGoal {
            object_name: self.config.object.clone(),
            force: self.config.force,
            ..ModelObjectGoal::default()
        };
        run_goal(&node, &goal, stop).await
    }

    /// What is added to the modeller's report.
    fn facts(
        &self,
        ending: &RunEnding,
        assessment: Option<&Assessment>,
        wall: Duration,
    ) -> Map<String, Value> {
        let mut facts = vec![
            ("program", json!(format!("puffer {}", env!("CARGO_PKG_VERSION")))),
            ("setup", json!(self.config.setup)),
            ("object", json!(self.config.object)),
            ("domain", json!(self.domain)),
            ("one_process", json!(self.config.one_process)),
            ("wall_seconds", json!(wall.as_secs_f64())),
            ("evaluation", results::assessment_json(assessment)),
        ];
        if let RunEnding::Failed(why) = ending {
            facts.push(("failure", json!(why)));
        }
        facts.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
    }
}

/// Checks before anything is started that an object can be simulated.
///
/// # Errors
/// No such object, or a mesh that is not closed.
pub(crate) fn check_object(object: &str) -> Result<()> {
    let path = Path::new(object);
    if path.extension().is_some() || path.exists() {
        let mesh: Mesh = puffer_core::mesh::io::read_mesh(path)?;
        puffer_core::simulate::objects::check_ground_truth(&mesh)
            .with_context(|| object.to_owned())?;
    } else if !puffer_core::simulate::objects::object_names().contains(&object) {
        puffer_core::simulate::objects::make_object(object)?;
    }
    Ok(())
}
