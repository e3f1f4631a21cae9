//! What a run notes in its bag.

use anyhow::{Context, Result};
use puffer_core::params::{ParamValue, Parameters};
use puffer_core::scans::{SensorKind, Support};
use puffer_shell::bag::BagReader;
use puffer_shell::scans::{NOTES, PARAMETER_NOTE};
use serde_json::Value;
use std::path::Path;

/// The notes of a bag; empty for one that no run of ours made.
pub(crate) struct Notes {
    /// The parameter file, as a map of nodes.
    nodes: Value,
}

impl Notes {
    /// Reads them.
    ///
    /// # Errors
    /// No bag, or a note that is no parameter file.
    pub(crate) fn read(path: &Path) -> Result<Notes> {
        Notes::of(&BagReader::open(path)?).with_context(|| path.display().to_string())
    }

    pub(super) fn of(bag: &BagReader) -> Result<Notes> {
        let texts = bag.metadata(NOTES).unwrap_or_default();
        let nodes = match texts.get(PARAMETER_NOTE) {
            Some(text) => serde_yaml_ng::from_str(text)
                .with_context(|| format!("its note `{PARAMETER_NOTE}` is no parameter file"))?,
            None => Value::Null,
        };
        Ok(Notes { nodes })
    }

    /// One parameter of a node.
    pub(crate) fn get(&self, node: &str, group: &str, field: &str) -> Option<&Value> {
        self.nodes.get(node)?.get("ros__parameters")?.get(group)?.get(field)
    }

    /// Sets in `params` what the run had set for `node` in the groups; what there is no longer is passed over.
    ///
    /// # Errors
    /// A value that its parameter cannot have.
    pub(crate) fn apply<P: Parameters>(
        &self,
        params: &mut P,
        node: &str,
        groups: &[&str],
    ) -> Result<()> {
        for spec in P::all_specs() {
            let Some((group, field)) = spec.name.split_once('.') else { continue };
            if let (true, Some(value)) = (groups.contains(&group), self.get(node, group, field)) {
                params
                    .set_named(group, field, value)
                    .with_context(|| format!("the bag's note `{PARAMETER_NOTE}` for {node}"))?;
            }
        }
        Ok(())
    }

    /// The noise family of the scans.
    pub(super) fn sensor(&self) -> Option<SensorKind> {
        SensorKind::from_word(self.get("modeller", "modeller", "sensor")?.as_str()?)
    }

    /// What the object stood on.
    pub(super) fn support(&self) -> Support {
        let value = self.get("modeller", "modeller", "support");
        value.and_then(Support::from_value).unwrap_or_default()
    }
}
