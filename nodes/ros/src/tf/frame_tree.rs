//! The tree of all frames.

use super::frame_link::{FrameLink, ParentPose};
use super::{TfError, Transform};
use crate::Stamp;
use puffer_core::geometry::Pose;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// The links of all frames to their parents, by the child's name.
#[derive(Debug, Default)]
pub(crate) struct FrameTree {
    links: BTreeMap<String, FrameLink>,
}

/// The frames from a start frame towards its root, each with its pose `frame_from_start` (none for
/// the start itself).
struct Chain {
    frames: Vec<(String, Option<Pose>)>,
    /// Why the chain ends before the root, if it does.
    failure: Option<TfError>,
}

impl Chain {
    fn root(&self) -> String {
        self.frames.last().map(|(frame, _)| frame.clone()).unwrap_or_default()
    }
}

impl FrameTree {
    /// Adds a transform; of a moving frame those older than `window` before its newest are
    /// forgotten.
    pub fn insert(&mut self, transform: Transform, is_static: bool, window: Duration) {
        let (child, link) = FrameLink::new(transform, is_static);
        match self.links.get_mut(&child) {
            Some(known) => known.update(link, window),
            None => {
                self.links.insert(child, link);
            }
        }
    }

    /// `target_from_source` at a stamp.
    pub fn lookup(&self, target: &str, source: &str, stamp: Stamp) -> Result<Pose, TfError> {
        self.check_known(target)?;
        self.check_known(source)?;
        let to = self.chain_to_root(target, |child, link| link.at(child, stamp).map(Some));
        let from = self.chain_to_root(source, |child, link| link.at(child, stamp).map(Some));
        let (to_steps, from_steps) = find_common_ancestor(target, source, &to, &from)?;
        Ok(match (&to.frames[to_steps].1, &from.frames[from_steps].1) {
            (None, None) => Pose::identity(),
            (None, Some(pose)) => *pose,
            (Some(pose), None) => pose.inverse(),
            (Some(a), Some(b)) => a.inverse() * b,
        })
    }

    /// The newest stamp that all moving links between the frames have reached; 0 if none moves.
    pub fn newest(&self, target: &str, source: &str) -> Result<Stamp, TfError> {
        self.check_known(target)?;
        self.check_known(source)?;
        let to = self.chain_to_root(target, |_, link| Ok(newest_parent(link)));
        let from = self.chain_to_root(source, |_, link| Ok(newest_parent(link)));
        let (to_steps, from_steps) = find_common_ancestor(target, source, &to, &from)?;
        let passed = to.frames[..to_steps].iter().chain(&from.frames[..from_steps]);
        let stamps = passed.filter_map(|(frame, _)| self.links.get(frame)?.newest()?.0);
        Ok(stamps.min().unwrap_or_default())
    }

    /// The chain from a frame to its root, or to where `sample` fails or a frame comes twice.
    fn chain_to_root(
        &self,
        start: &str,
        sample: impl Fn(&str, &FrameLink) -> Result<Option<ParentPose>, TfError>,
    ) -> Chain {
        let mut frames: Vec<(String, Option<Pose>)> = vec![(start.to_owned(), None)];
        let mut seen = BTreeSet::from([start.to_owned()]);
        while let Some((child, so_far)) = frames.last() {
            let Some(link) = self.links.get(child) else { break };
            let sample = match sample(child, link) {
                Ok(Some(sample)) => sample,
                Ok(None) => break,
                Err(failure) => return Chain { frames, failure: Some(failure) },
            };
            if !seen.insert(sample.parent.clone()) {
                break;
            }
            let pose = so_far.map_or(sample.pose, |so_far| sample.pose * so_far);
            frames.push((sample.parent, Some(pose)));
        }
        Chain { frames, failure: None }
    }

    /// Fails if no transform has named the frame.
    fn check_known(&self, frame: &str) -> Result<(), TfError> {
        if self.links.contains_key(frame) {
            return Ok(());
        }
        let frames = self.frames();
        if frames.contains(frame) {
            return Ok(());
        }
        let known = match frames.is_empty() {
            true => "none yet".to_owned(),
            false => Vec::from_iter(frames).join(", "),
        };
        Err(TfError::UnknownFrame { frame: frame.to_owned(), known })
    }

    fn frames(&self) -> BTreeSet<&str> {
        let mut frames = BTreeSet::new();
        for (child, link) in &self.links {
            frames.insert(child.as_str());
            match link {
                FrameLink::Static(sample) => {
                    frames.insert(sample.parent.as_str());
                }
                FrameLink::Moving(samples) => {
                    frames.extend(samples.values().map(|s| s.parent.as_str()))
                }
            }
        }
        frames
    }
}

/// The newest parent of a frame and its pose there.
fn newest_parent(link: &FrameLink) -> Option<ParentPose> {
    link.newest().map(|(_, sample)| sample.clone())
}

/// The positions of the first common frame in both chains.
fn find_common_ancestor(
    target: &str,
    source: &str,
    to: &Chain,
    from: &Chain,
) -> Result<(usize, usize), TfError> {
    for (i, (frame, _)) in from.frames.iter().enumerate() {
        if let Some(j) = to.frames.iter().position(|(other, _)| other == frame) {
            return Ok((j, i));
        }
    }
    if let Some(failure) = from.failure.clone().or_else(|| to.failure.clone()) {
        return Err(failure);
    }
    Err(TfError::NotConnected {
        target_frame: target.to_owned(),
        source_frame: source.to_owned(),
        target_root: to.root(),
        source_root: from.root(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOW: Duration = Duration::from_secs(10);

    /// a <- b (moving, seconds 1 and 3), b <- c (static), a <- d (moving, second 2).
    fn tree() -> FrameTree {
        let mut tree = FrameTree::default();
        for (parent, child, second, x, is_static) in [
            ("a", "b", 1.0, 1.0, false),
            ("a", "b", 3.0, 3.0, false),
            ("b", "c", 0.0, 0.5, true),
            ("a", "d", 2.0, 10.0, false),
        ] {
            let pose = Pose::translation(x, 0.0, 0.0);
            let stamp = Stamp::from_seconds(second);
            let transform = Transform { parent: parent.into(), child: child.into(), stamp, pose };
            tree.insert(transform, is_static, WINDOW);
        }
        tree
    }

    fn position(target: &str, source: &str, second: f64) -> f64 {
        let pose = tree().lookup(target, source, Stamp::from_seconds(second)).unwrap();
        pose.translation.x
    }

    #[test]
    fn a_lookup_goes_up_down_and_across() {
        assert_eq!(position("a", "c", 2.0), 2.5);
        assert_eq!(position("c", "a", 2.0), -2.5);
        assert_eq!(position("d", "c", 2.0), -7.5);
        assert_eq!(position("b", "c", 99.0), 0.5);
        assert_eq!(position("a", "a", 99.0), 0.0);
    }

    #[test]
    fn the_newest_stamp_is_the_oldest_of_the_newest_ones_on_the_way() {
        let tree = tree();
        for (target, source, second) in [("a", "c", 3.0), ("d", "c", 2.0), ("b", "c", 0.0)] {
            assert_eq!(tree.newest(target, source), Ok(Stamp::from_seconds(second)));
        }
    }

    #[test]
    fn an_unknown_frame_is_named_with_the_known_ones() {
        let error = tree().lookup("a", "hand", Stamp::ZERO).unwrap_err();
        let (frame, known) = ("hand".to_owned(), "a, b, c, d".to_owned());
        assert_eq!(error, TfError::UnknownFrame { frame, known });
    }
}
