//! One modelling run over DDS, from start to report.

mod folder;
mod goal;
mod recorder;
mod results;
mod table;

use crate::fleet::{Crew, Fleet};
use crate::nodes::NODES;
use crate::setups::{Setting, output, parameter_file};
use crate::verdict;
use anyhow::{Context, Result, anyhow, bail};
use folder::RunFolder;
use goal::{Ending, pursue};
use puffer_core::Error;
use puffer_core::assess::Assessment;
use puffer_core::mesh::Mesh;
use puffer_core::verdict::ModelVerdict;
use puffer_msgs::action::ModelObjectGoal;
use puffer_shell::scans::PARAMETER_NOTE;
use puffer_shell::{NoParams, Node, RosArgs, Stop, domain};
use recorder::Recorder;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How long the runtime may take to end.
const GRACE: Duration = Duration::from_secs(1);

/// What is to be run.
pub(crate) struct Plan {
    pub setup: String,
    pub object: String,
    pub out: Option<PathBuf>,
    pub settings: Vec<Setting>,
    pub one_process: bool,
    pub domain: Option<u16>,
    pub bag: bool,
    /// Whether a mesh is wanted that is not trustworthy.
    pub force: bool,
}

/// A run whose folder is made.
pub(crate) struct Run {
    plan: Plan,
    folder: RunFolder,
    domain: u16,
}

impl Run {
    /// Makes the run folder, finds a domain and writes the parameter file.
    ///
    /// # Errors
    /// An object that cannot be simulated, a folder that is taken, or a domain in use.
    pub(crate) fn new(mut plan: Plan) -> Result<Run> {
        check_object(&plan.object)?;
        let domain = match plan.domain {
            Some(domain) if !domain::is_free(domain) => {
                bail!(
                    "DDS domain {domain} is in use by another program: leave --domain out to get a free one"
                )
            }
            Some(domain) => domain,
            None => domain::free()?,
        };
        let stem = Path::new(&plan.object)
            .file_stem()
            .map_or_else(String::new, |s| s.to_string_lossy().into());
        let folder = RunFolder::create(plan.out.as_deref(), &format!("{}-{stem}", plan.setup))?;
        plan.settings.extend(output(&folder.path().display().to_string()));
        let params = folder.file("params.yaml");
        std::fs::write(&params, parameter_file(&NODES, &plan.settings, Some(true)))
            .with_context(|| format!("cannot write {}", params.display()))?;
        Ok(Run { plan, folder, domain })
    }

    /// Runs it and prints the results.
    ///
    /// # Errors
    /// Whatever kept a mesh from being made; what was measured is in the run folder.
    pub(crate) fn model(self, json: bool) -> Result<()> {
        let since = Instant::now();
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
        let driven = runtime.block_on(self.drive());
        runtime.shutdown_timeout(GRACE);
        let (ending, problems) = driven?;
        for problem in &problems {
            eprintln!("puffer: {problem}");
        }
        let assessment = results::finish(&self.folder)?;
        let facts = self.facts(&ending, assessment.as_ref(), since.elapsed());
        results::extend_report(&self.folder, facts)?;
        let report = results::report(&self.folder);
        match ending {
            Ending::Modelled => {
                table::print(&report, assessment.as_ref(), self.folder.path(), json);
                self.judge(&report, true)
            }
            Ending::NotTrustworthy(why) => {
                table::print(&report, None, self.folder.path(), json);
                self.judge(&report, false)?;
                Err(anyhow!(why))
            }
            Ending::Cancelled => {
                eprintln!(
                    "puffer: interrupted; what was measured is in {}",
                    self.folder.path().display()
                );
                Err(Error::Cancelled.into())
            }
            Ending::Failed(why) => {
                Err(anyhow!("{why}; what was measured is in {}", self.folder.path().display()))
            }
        }
    }

    /// Tells what the verdict on the whole says against the model, as a warning if there is a mesh.
    fn judge(&self, report: &Map<String, Value>, has_mesh: bool) -> Result<()> {
        let folder = self.folder.path().display();
        let how = format!(
            "what was measured is in {folder}, and puffer reconstruct {folder}/scans -o mesh.ply --force makes a mesh \
             of it all the same"
        );
        verdict::pass(&ModelVerdict::from_facts(report), has_mesh, &how)
    }

    /// Starts the nodes, pursues the goal, and stops them again; what they had to complain of at the end.
    async fn drive(&self) -> Result<(Ending, Vec<String>)> {
        let stop = Stop::on_signals()?;
        let crew = Crew {
            nodes: NODES.iter().collect(),
            domain: self.domain,
            params: self.folder.file("params.yaml"),
            more: Vec::new(),
            log: Some(self.folder.file("log.txt")),
        };
        eprintln!("run folder {}", self.folder.path().display());
        // Before those who speak.
        let recorder = if self.plan.bag {
            Some(Recorder::start(self.domain, &self.folder.file("bag.mcap"), self.notes()?).await?)
        } else {
            None
        };
        let mut fleet = Fleet::start(&crew, self.plan.one_process)?;
        let roll: Vec<String> =
            fleet.roll().iter().map(|(name, process)| format!("{name} {process}")).collect();
        eprintln!("nodes on DDS domain {}: {}", self.domain, roll.join(", "));
        let ending = tokio::select! {
            // Whatever it was, the nodes are stopped in order.
            ending = self.pursue(&stop) => {
                ending.unwrap_or_else(|error| Ending::Failed(format!("{error:#}")))
            }
            why = fleet.loss() => Ending::Failed(why),
        };
        let mut problems = fleet.stop().await;
        if let Some(recorder) = recorder {
            problems.extend(recorder.stop().await.err().map(|error| format!("{error:#}")));
        }
        Ok((ending, problems))
    }

    /// What the bag says beside the messages.
    fn notes(&self) -> Result<BTreeMap<String, String>> {
        let seed = self.plan.settings.iter().rev().find(|s| s.name == "driver.seed");
        let params = self.folder.file("params.yaml");
        let params = std::fs::read_to_string(&params)
            .with_context(|| format!("cannot read {}", params.display()))?;
        let notes = [
            (PARAMETER_NOTE, params),
            ("program", format!("puffer {}", env!("CARGO_PKG_VERSION"))),
            ("setup", self.plan.setup.clone()),
            ("object", self.plan.object.clone()),
            ("seed", seed.map_or_else(String::new, |s| s.value.to_string())),
        ];
        Ok(notes.map(|(key, text)| (key.to_owned(), text)).into())
    }

    async fn pursue(&self, stop: &Stop) -> Result<Ending> {
        // Its own stop: Ctrl-C cancels the goal first, and the goal needs the node.
        let args = RosArgs::parse(std::iter::empty())?.with_domain(self.domain);
        let node: Node<NoParams> = Node::start("puffer_model", args, Stop::new()).await?;
        let goal = ModelObjectGoal {
            object_name: self.plan.object.clone(),
            force: self.plan.force,
            ..ModelObjectGoal::default()
        };
        pursue(&node, &goal, stop).await
    }

    /// What the report says beside the modeller's part.
    fn facts(
        &self,
        ending: &Ending,
        assessment: Option<&Assessment>,
        wall: Duration,
    ) -> Map<String, Value> {
        let mut facts = Map::new();
        let mut add = |key: &str, value: Value| facts.insert(key.to_owned(), value);
        add("program", json!(format!("puffer {}", env!("CARGO_PKG_VERSION"))));
        add("setup", json!(self.plan.setup));
        add("object", json!(self.plan.object));
        add("domain", json!(self.domain));
        add("one_process", json!(self.plan.one_process));
        add("wall_seconds", json!(wall.as_secs_f64()));
        add("evaluation", results::figures(assessment));
        if let Ending::Failed(why) = ending {
            add("failure", json!(why));
        }
        facts
    }
}

/// An object that cannot be simulated is told before anything is started.
pub(crate) fn check_object(object: &str) -> Result<()> {
    let path = Path::new(object);
    if path.extension().is_some() || path.exists() {
        let mesh: Mesh = puffer_core::mesh::io::read_mesh(path)?;
        puffer_core::simulate::objects::check_ground_truth(&mesh)
            .with_context(|| object.to_owned())?;
    } else if !puffer_core::simulate::objects::names().contains(&object) {
        puffer_core::simulate::objects::make(object)?;
    }
    Ok(())
}
