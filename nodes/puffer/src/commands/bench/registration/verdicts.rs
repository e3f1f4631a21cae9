//! Whether verdicts on pairs can be believed: the table of trials.

use super::family;
use crate::commands::simulate::truth_of;
use crate::table::print_text;
use anyhow::Result;
use puffer_core::Progress;
use puffer_core::assess::{Trial, TrialKind, TrialScan, trial_scans, trials};
use puffer_core::register::RegisterParams;
use puffer_core::simulate::{SimulateParams, simulate};
use std::path::Path;

/// Makes `count` trials with each object and noise family, and prints a line for each.
pub(super) fn run(
    objects: &[String],
    families: &[String],
    (views, count, seed): (usize, usize, u64),
    params: &RegisterParams,
) -> Result<()> {
    print_text(
        "pairs moved off and aligned again: near (1-5 degrees, 1-8 mm) and far (5-20, 8-30) with at least 40 % overlap, \
         apart (5 % at most),\nalien (of the next object); false: accepted although apart or alien, or beyond 5 mm and \
         5 standard deviations\n",
    );
    for word in families {
        let of = SimulateParams { family: family(word)?, views, ..Default::default() };
        let scans = |object: &String| -> Result<Vec<TrialScan>> {
            let scans = simulate(&truth_of(object)?, &of, seed, &Progress::silent())?;
            Ok(trial_scans(&scans, params)?)
        };
        let sets: Vec<Vec<TrialScan>> = objects.iter().map(scans).collect::<Result<_>>()?;
        for (i, object) in objects.iter().enumerate() {
            let aliens = if sets.len() > 1 { &sets[(i + 1) % sets.len()] } else { &Vec::new() };
            let made = trials(&sets[i], aliens, count, seed, params);
            let name = Path::new(object).file_stem().unwrap_or_default().to_string_lossy();
            for trial in made.iter().filter(|t| t.false_success()) {
                print_text(&detail(trial));
            }
            print_text(&line(&name, of.family.sensor(), &made));
        }
    }
    Ok(())
}

fn detail(trial: &Trial) -> String {
    let (moving, fixed) = trial.views;
    let (before, after) = trial.error;
    format!(
        "  false: {:?}, view {moving} onto {fixed}, true overlap {:.0} %: {before:.1} mm off, then {after:.1}; {} \
         ({:.0} % overlap, residual {:.2} mm)\n",
        trial.kind,
        trial.overlap * 100.0,
        trial.verdict.reason,
        trial.verdict.overlap * 100.0,
        trial.verdict.rmse * 1e3
    )
}

fn line(object: &str, sensor: &str, made: &[Trial]) -> String {
    let accepted = |kind: TrialKind| {
        let of: Vec<&Trial> = made.iter().filter(|t| t.kind == kind).collect();
        let yes = of.iter().filter(|t| t.accepted()).count();
        format!("{kind:?} {yes} of {}", of.len()).to_lowercase()
    };
    let kinds = [TrialKind::Near, TrialKind::Far, TrialKind::Apart, TrialKind::Alien];
    let mut nees: Vec<f64> =
        made.iter().filter(|t| t.kind == TrialKind::Near && t.accepted()).map(|t| t.nees).collect();
    nees.sort_by(f64::total_cmp);
    let at = |part: f64| puffer_core::assess::quantile(&nees, part);
    format!(
        "{object:<12} {sensor:<6} tried {}: accepted {}; false {}; squared error over covariance (near): median \
         {:.1} (5.3 expected), 90 % {:.1} (10.6)\n",
        made.len(),
        kinds.map(accepted).join(", "),
        made.iter().filter(|t| t.false_success()).count(),
        at(0.5),
        at(0.9)
    )
}
