//! How a run ended, and what its report says of that.

use puffer_core::session::{SessionOutcome, SessionState};
use puffer_core::verdict::{ModelVerdict, ScanCount};
use puffer_msgs::action::ReconstructMeshResult;
use serde_json::{Map, Value, json};

/// How a run ended.
pub(crate) struct End {
    pub outcome: SessionOutcome,
    pub state: SessionState,
}

/// The verdict on the model of a run that ended with `mesh`.
pub(crate) fn model_verdict(end: &End, mesh: &ReconstructMeshResult) -> ModelVerdict {
    if mesh.scans == 0 {
        // Without a mesh, the scans that were counted are all that is known.
        let scans = ScanCount::new(end.state.scans, end.state.accepted);
        return ModelVerdict { scans, cells_explained: None };
    }
    let explained = Some(f64::from(mesh.share_of_cells_explained));
    ModelVerdict {
        scans: ScanCount::new(mesh.scans as usize, mesh.accepted as usize),
        cells_explained: explained.filter(|share| share.is_finite()),
    }
}

/// What the report says of a run that ended with `mesh`.
pub(crate) fn report_facts(end: &End, mesh: &ReconstructMeshResult) -> Map<String, Value> {
    let verdict = model_verdict(end, mesh);
    let mut facts = verdict.to_json();
    let (outcome, reason) = match &end.outcome {
        SessionOutcome::Modelled(reason) => ("modelled", reason.clone()),
        SessionOutcome::Failed(..) if !mesh.success && mesh.vertices > 0 => {
            ("not trustworthy", end.state.reason.clone())
        }
        SessionOutcome::Failed(phase, reason) => ("failed", format!("{phase:?}: {reason}")),
        SessionOutcome::Cancelled => ("cancelled", "on request".to_owned()),
    };
    for (key, value) in [
        ("outcome", json!(outcome)),
        ("reason", json!(reason)),
        ("scans", json!(verdict.scans.map_or(end.state.scans, |scans| scans.all()))),
        ("accepted_scans", json!(verdict.scans.map_or(0, |scans| scans.accepted()))),
        ("coverage", json!(end.state.coverage)),
        ("mesh", mesh_facts(mesh)),
    ] {
        facts.insert(key.to_owned(), value);
    }
    facts
}

fn mesh_facts(mesh: &ReconstructMeshResult) -> Value {
    if !mesh.success {
        return Value::Null;
    }
    json!({
        "path": mesh.mesh_path,
        "vertices": mesh.vertices,
        "triangles": mesh.triangles,
        "genus": mesh.genus,
        "closed": mesh.closed,
        "mean_sigma": mesh.mean_sigma,
        "unobserved_share": mesh.unobserved_share,
        "seconds": mesh.seconds,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::session::{Phase, SessionParams};

    fn end(outcome: SessionOutcome) -> End {
        End { outcome, state: SessionState::new(SessionParams::default()) }
    }

    #[test]
    fn a_mesh_with_a_verdict_gives_the_counts_and_the_shares() {
        let mesh = ReconstructMeshResult {
            success: true,
            scans: 4,
            accepted: 3,
            share_of_cells_explained: 0.75,
            mesh_path: "/tmp/mesh.ply".into(),
            ..ReconstructMeshResult::default()
        };
        let facts = report_facts(&end(SessionOutcome::Modelled("enough".into())), &mesh);
        assert_eq!(facts["outcome"], "modelled");
        assert_eq!(facts["reason"], "enough");
        assert_eq!((&facts["scans"], &facts["accepted_scans"]), (&json!(4), &json!(3)));
        assert_eq!(facts["share_of_scans_accepted"], 0.75);
        assert_eq!(facts["share_of_cells_explained"], 0.75);
        assert_eq!(facts["mesh"]["path"], "/tmp/mesh.ply");
    }

    #[test]
    fn a_failure_before_the_mesh_names_its_phase_and_a_refused_mesh_is_not_trustworthy() {
        let mut failed = end(SessionOutcome::Failed(Phase::Scanning, "no answer".into()));
        (failed.state.scans, failed.state.accepted) = (2, 1);
        let facts = report_facts(&failed, &ReconstructMeshResult::default());
        assert_eq!(facts["outcome"], "failed");
        assert_eq!(facts["reason"], "Scanning: no answer");
        assert_eq!((&facts["scans"], &facts["accepted_scans"]), (&json!(2), &json!(1)));
        assert_eq!(facts["mesh"], Value::Null);

        let nan = f32::NAN;
        let refused = ReconstructMeshResult {
            vertices: 10,
            scans: 2,
            accepted: 1,
            share_of_cells_explained: nan,
            ..ReconstructMeshResult::default()
        };
        failed.state.reason = "no view is left".into();
        let facts = report_facts(&failed, &refused);
        assert_eq!(facts["outcome"], "not trustworthy");
        assert_eq!(facts["reason"], "no view is left");
        assert_eq!(facts["share_of_cells_explained"], Value::Null);
        assert_eq!(facts["mesh"], Value::Null);
    }
}
