//! Why planning ends.

use super::plan::Candidate;

crate::choice! {
    /// What planning ended for.
    pub enum Cause {
        /// No predefined view is left from which surface could be found.
        NoFirstView = "no_first_view",
        /// No voxel asks to be seen but from views already used.
        NothingAsks = "nothing_asks",
        /// No view would show enough that is new, or none does from where the robot can take it.
        NotWorthIt = "not_worth_it",
        /// Views would show something new, but the robot refuses them.
        Refused = "refused",
    }
}

/// Why no view is left.
#[derive(Clone, Debug, PartialEq)]
pub struct Ending {
    /// The kind.
    pub cause: Cause,
    /// The same with all numbers, as a person reads it.
    pub text: String,
    /// What the robot refused views for, each with the number of views, the most frequent first.
    pub refusals: Vec<(&'static str, usize)>,
    /// Number of views that the robot takes, but from where they show too little that is new.
    pub not_worth_it: usize,
}

impl Ending {
    pub(crate) fn new(cause: Cause, text: String) -> Ending {
        Ending { cause, text, refusals: Vec::new(), not_worth_it: 0 }
    }

    /// Of a plan before any surface was seen, after so many `scans`, that was given none of the predefined views.
    pub(crate) fn at_first(candidates: &[Candidate], scans: usize) -> Ending {
        let refusals = refusals(candidates);
        let text = match scans {
            0 => format!(
                "none of {} predefined views can be taken: {}",
                candidates.len(),
                refused_in_words(&refusals)
            ),
            n => format!(
                "no surface was measured in the region of interest in {n} scans, and no predefined view is left: \
                 check the region and the poses"
            ),
        };
        Ending { cause: Cause::NoFirstView, text, refusals, not_worth_it: 0 }
    }

    /// Of a plan that asked for all of `candidates` and was given none that shows `floor` new voxels.
    pub(crate) fn of(candidates: &[Candidate], floor: f64) -> Ending {
        let refusals = refusals(candidates);
        let refused = total(&refusals);
        let not_worth_it = candidates.len() - refused;
        let mut parts = Vec::new();
        if refused > 0 {
            parts.push(refused_in_words(&refusals));
        }
        if not_worth_it > 0 {
            parts.push(format!(
                "{not_worth_it} would show less than {floor:.1} new voxels from where it can take them"
            ));
        }
        let text = format!(
            "no view is left of {} that would show something new: {}",
            candidates.len(),
            parts.join(", ")
        );
        let cause = if refused > 0 { Cause::Refused } else { Cause::NotWorthIt };
        Ending { cause, text, refusals, not_worth_it }
    }

    /// Number of views that the robot refused.
    pub fn refused(&self) -> usize {
        total(&self.refusals)
    }
}

/// What the robot refused, most frequent first; of equally frequent ones, that of the better view.
fn refusals(candidates: &[Candidate]) -> Vec<(&'static str, usize)> {
    let mut counts: Vec<(&'static str, usize)> = Vec::new();
    for kind in candidates.iter().filter_map(|candidate| candidate.refusal) {
        match counts.iter_mut().find(|(known, _)| *known == kind) {
            Some((_, count)) => *count += 1,
            None => counts.push((kind, 1)),
        }
    }
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    counts
}

fn total(refusals: &[(&'static str, usize)]) -> usize {
    refusals.iter().map(|(_, count)| count).sum()
}

fn refused_in_words(refusals: &[(&'static str, usize)]) -> String {
    let kinds: Vec<String> =
        refusals.iter().map(|(kind, count)| format!("{count} {kind}")).collect();
    format!("the robot refuses {} ({})", total(refusals), kinds.join(", "))
}
