//! One iteration of ICP: stages 2 to 5.

use super::map::Map;
use super::matching::{Correspondence, Matcher};
use super::metric::NormalEquations;
use super::rejection::reject;
use super::selection::points_taken;
use super::source::Source;
use crate::geometry::Pose;
use crate::register::strategy::Strategy;

/// Matches a scan with the map, iteration by iteration.
pub(super) struct IcpIteration<'a> {
    source: Source<'a>,
    map: &'a Map,
    strategy: &'a Strategy,
    iteration: usize,
    /// How many of the points take part now.
    taken: usize,
    matcher: Matcher<'a>,
}

impl<'a> IcpIteration<'a> {
    pub(super) fn new(
        source: Source<'a>,
        map: &'a Map,
        strategy: &'a Strategy,
    ) -> IcpIteration<'a> {
        let taken = points_taken(strategy.selection, source.points.len(), 0);
        let matcher = Matcher::new(source.first(taken), map, strategy.matching);
        IcpIteration { source, map, strategy, iteration: 0, taken, matcher }
    }

    /// Whether all points take part already.
    pub(super) fn takes_all(&self) -> bool {
        self.taken == self.source.points.len()
    }

    /// The normal equations at `pose` of the pairs within `reach` (metres).
    pub(super) fn next(&mut self, pose: &Pose, reach: f64) -> NormalEquations {
        let taken = points_taken(self.strategy.selection, self.source.points.len(), self.iteration);
        if taken != self.taken {
            self.taken = taken;
            self.matcher = Matcher::new(self.source.first(taken), self.map, self.strategy.matching);
        }
        self.iteration += 1;
        let mut pairs = self.matcher.find(pose, reach);
        reject(&mut pairs, self.strategy);
        NormalEquations::new(&pairs, &self.source, pose, self.strategy)
    }
}

/// The pairs of the scan's points at `pose` and the map's within `reach` (metres) that are not
/// rejected.
pub(crate) fn correspondences(
    source: &Source,
    map: &Map,
    pose: &Pose,
    reach: f64,
    strategy: &Strategy,
) -> Vec<Correspondence> {
    let mut pairs = Matcher::new(*source, map, strategy.matching).find(pose, reach);
    reject(&mut pairs, strategy);
    pairs
}
