//! Trials of verdicts on pairs of scans, printed as a table.

use crate::simulated_input::parse_noise_family;
use anyhow::Result;
use puffer::commands::simulate::load_object;
use puffer::table::print_text;
use puffer_core::Progress;
use puffer_core::assess::{
    PairTrial, TrialKind, TrialScan, prepare_trial_scans, quantile, run_pair_trials,
};
use puffer_core::register::RegisterParams;
use puffer_core::simulate::{SimulateParams, simulate};
use std::path::Path;

/// Kinds of trials in the order of the table.
const KINDS: [TrialKind; 4] = [TrialKind::Near, TrialKind::Far, TrialKind::Apart, TrialKind::Alien];

/// Number of the views, of the trials and of the random numbers of each table.
pub(super) struct TrialSeries {
    /// Views of each object.
    pub views: usize,
    /// Trials with each object and noise family.
    pub count: usize,
    pub seed: u64,
}

/// Runs trials with each object and noise family and prints a line for each.
pub(super) fn run(
    objects: &[String],
    families: &[String],
    series: &TrialSeries,
    params: &RegisterParams,
) -> Result<()> {
    print_text(
        "pairs moved off and aligned again: near (1-5 degrees, 1-8 mm) and far (5-20, 8-30) with at least 40 % overlap, \
         apart (5 % at most),\nalien (of the next object); false: accepted although apart or alien, or beyond 5 mm and \
         5 standard deviations\n",
    );
    for word in families {
        let simulation = SimulateParams {
            family: parse_noise_family(word)?,
            views: series.views,
            ..Default::default()
        };
        let mut sets: Vec<Vec<TrialScan>> = Vec::new();
        for object in objects {
            let truth = load_object(object)?;
            let scans = simulate(&truth, &simulation, series.seed, &Progress::silent())?;
            sets.push(prepare_trial_scans(&scans, params)?);
        }
        for (i, object) in objects.iter().enumerate() {
            // The next object is the alien; a single object has none.
            let aliens = if sets.len() > 1 { &sets[(i + 1) % sets.len()] } else { &Vec::new() };
            let trials = run_pair_trials(&sets[i], aliens, series.count, series.seed, params);
            let name = Path::new(object).file_stem().unwrap_or_default().to_string_lossy();
            for trial in trials.iter().filter(|t| t.is_false_success()) {
                print_text(&describe_false_success(trial));
            }
            print_text(&summarize(&name, simulation.family.sensor_name(), &trials));
        }
    }
    Ok(())
}

fn describe_false_success(trial: &PairTrial) -> String {
    let (moving, fixed) = trial.views;
    format!(
        "  false: {:?}, view {moving} onto {fixed}, true overlap {:.0} %: {:.1} mm off, then {:.1}; {} \
         ({:.0} % overlap, residual {:.2} mm)\n",
        trial.kind,
        trial.overlap * 100.0,
        trial.error_before,
        trial.error_after,
        trial.verdict.reason,
        trial.verdict.overlap * 100.0,
        trial.verdict.rmse * 1e3
    )
}

/// The line of the table for one object and sensor.
fn summarize(object: &str, sensor: &str, trials: &[PairTrial]) -> String {
    let near = trials.iter().filter(|t| t.kind == TrialKind::Near && t.is_accepted());
    let mut nees: Vec<f64> = near.map(|t| t.nees.unwrap_or(f64::NAN)).collect();
    nees.sort_by(f64::total_cmp);
    format!(
        "{object:<12} {sensor:<6} tried {}: accepted {}; false {}; squared error over covariance (near): median \
         {:.1} (5.3 expected), 90 % {:.1} (10.6)\n",
        trials.len(),
        KINDS.map(|kind| count_accepted(kind, trials)).join(", "),
        trials.iter().filter(|t| t.is_false_success()).count(),
        quantile(&nees, 0.5),
        quantile(&nees, 0.9)
    )
}

/// How many of the trials of this kind were accepted, in words.
fn count_accepted(kind: TrialKind, trials: &[PairTrial]) -> String {
    let of_kind: Vec<&PairTrial> = trials.iter().filter(|t| t.kind == kind).collect();
    let accepted = of_kind.iter().filter(|t| t.is_accepted()).count();
    format!("{kind:?} {accepted} of {}", of_kind.len()).to_lowercase()
}
