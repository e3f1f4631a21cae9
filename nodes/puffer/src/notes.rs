//! What a run notes in its bag.

use anyhow::{Context, Result};
use puffer_core::params::{ParamValue, Parameters};
use puffer_core::scan::{SensorKind, Support};
use puffer_ros::bag::BagReader;
use puffer_ros::scans::{PARAMETERS_METADATA_KEY, RUN_METADATA_NAME};
use serde_json::Value;
use std::path::Path;

/// The notes of a bag; empty for one that no run of ours made.
pub(crate) struct BagNotes {
    /// The parameter file, as a map of nodes.
    nodes: Value,
}

impl BagNotes {
    /// Reads them.
    ///
    /// # Errors
    /// No bag, or a note that is no parameter file.
    pub(crate) fn read(path: &Path) -> Result<BagNotes> {
        BagNotes::from_bag(&BagReader::open(path)?).with_context(|| path.display().to_string())
    }

    pub(crate) fn from_bag(bag: &BagReader) -> Result<BagNotes> {
        let texts = bag.metadata(RUN_METADATA_NAME).unwrap_or_default();
        let nodes = match texts.get(PARAMETERS_METADATA_KEY) {
            Some(text) => serde_yaml_ng::from_str(text).with_context(|| {
                format!("its note `{PARAMETERS_METADATA_KEY}` is no parameter file")
            })?,
            None => Value::Null,
        };
        Ok(BagNotes { nodes })
    }

    /// One parameter of a node.
    pub(crate) fn get(&self, node: &str, group: &str, field: &str) -> Option<&Value> {
        self.nodes.get(node)?.get("ros__parameters")?.get(group)?.get(field)
    }

    /// Sets in `params` what the run had set for `node` in the groups; what there is no longer is
    /// passed over.
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
                params.set_named(group, field, value).with_context(|| {
                    format!("the bag's note `{PARAMETERS_METADATA_KEY}` for {node}")
                })?;
            }
        }
        Ok(())
    }

    /// The noise family of the scans.
    pub(crate) fn sensor(&self) -> Option<SensorKind> {
        SensorKind::from_word(self.get("modeller", "modeller", "sensor")?.as_str()?)
    }

    /// What the object stood on.
    pub(crate) fn support(&self) -> Support {
        let value = self.get("modeller", "modeller", "support");
        value.and_then(Support::from_value).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::pipeline::PipelineParams;

    fn notes(text: &str) -> BagNotes {
        BagNotes { nodes: serde_yaml_ng::from_str(text).unwrap() }
    }

    #[test]
    fn only_the_groups_that_are_named_are_taken_over() {
        let notes = notes(
            "cloud_filter: {ros__parameters: {use_sim_time: true, filter: {noise_radius: 0.002, \
             former: 1}, reconstruct: {edge_length: 0.003}}}",
        );
        let mut params = PipelineParams::default();
        let edge_length = params.reconstruct.edge_length;
        notes.apply(&mut params, "cloud_filter", &["filter"]).unwrap();
        assert_eq!(params.filter.noise_radius, 0.002);
        assert_eq!(params.reconstruct.edge_length, edge_length);
        notes.apply(&mut params, "mesh_reconstructor", &["reconstruct"]).unwrap();
        assert_eq!(params.reconstruct.edge_length, edge_length);
    }

    #[test]
    fn a_value_that_its_parameter_cannot_have_names_the_note_and_the_node() {
        let notes = notes("cloud_filter: {ros__parameters: {filter: {noise_radius: wide}}}");
        let error =
            notes.apply(&mut PipelineParams::default(), "cloud_filter", &["filter"]).unwrap_err();
        let error = format!("{error:#}");
        for text in [PARAMETERS_METADATA_KEY, "cloud_filter", "filter.noise_radius"] {
            assert!(error.contains(text), "no {text} in {error}");
        }
    }

    #[test]
    fn sensor_and_support_are_those_of_the_modeller() {
        let known =
            notes("modeller: {ros__parameters: {modeller: {sensor: stereo, support: table}}}");
        assert_eq!(known.sensor(), Some(SensorKind::Stereo));
        assert_eq!(known.support(), Support::Table);
        let unknown = notes("~");
        assert_eq!((unknown.sensor(), unknown.support()), (None, Support::None));
    }
}
