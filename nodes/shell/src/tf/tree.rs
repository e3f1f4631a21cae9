//! The frames and how they hang together.

use super::samples::{Link, Sample};
use super::{TfError, Transform};
use crate::Stamp;
use puffer_core::geometry::Pose;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// The transforms of all frames, by child.
#[derive(Debug, Default)]
pub(crate) struct Tree {
    links: BTreeMap<String, Link>,
}

/// From a frame upwards: each frame, and its pose `frame_from_start` (none for the start itself).
struct Chain {
    frames: Vec<(String, Option<Pose>)>,
    /// Why it ends before the root.
    failure: Option<TfError>,
}

impl Tree {
    pub fn insert(&mut self, transform: Transform, is_static: bool, window: Duration) {
        let (child, link) = Link::new(transform, is_static);
        match self.links.get_mut(&child) {
            Some(known) => known.update(link, window),
            None => {
                self.links.insert(child, link);
            }
        }
    }

    pub fn lookup(&self, target: &str, source: &str, stamp: Stamp) -> Result<Pose, TfError> {
        self.check(target)?;
        self.check(source)?;
        let sample = |child: &str, link: &Link| link.at(child, stamp).map(Some);
        let to = self.climb(target, sample);
        let from = self.climb(source, sample);
        let (to_steps, from_steps) = meet(target, source, &to, &from)?;
        Ok(match (&to.frames[to_steps].1, &from.frames[from_steps].1) {
            (None, None) => Pose::identity(),
            (None, Some(pose)) => *pose,
            (Some(pose), None) => pose.inverse(),
            (Some(a), Some(b)) => a.inverse() * b,
        })
    }

    /// Newest stamp that all moving links between the frames have reached; 0 if none moves.
    pub fn newest(&self, target: &str, source: &str) -> Result<Stamp, TfError> {
        self.check(target)?;
        self.check(source)?;
        let sample = |_: &str, link: &Link| Ok(link.newest().map(|(_, sample)| sample.clone()));
        let to = self.climb(target, sample);
        let from = self.climb(source, sample);
        let (to_steps, from_steps) = meet(target, source, &to, &from)?;
        let passed = to.frames[..to_steps].iter().chain(&from.frames[..from_steps]);
        let stamps = passed.filter_map(|(frame, _)| self.links.get(frame)?.newest()?.0);
        Ok(stamps.min().unwrap_or_default())
    }

    /// Climbs from a frame to its root, or to where `sample` fails or a frame comes twice.
    fn climb(
        &self,
        start: &str,
        sample: impl Fn(&str, &Link) -> Result<Option<Sample>, TfError>,
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

    fn check(&self, frame: &str) -> Result<(), TfError> {
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
                Link::Static(sample) => {
                    frames.insert(sample.parent.as_str());
                }
                Link::Moving(samples) => frames.extend(samples.values().map(|s| s.parent.as_str())),
            }
        }
        frames
    }
}

/// Places of the first common frame in both chains.
fn meet(target: &str, source: &str, to: &Chain, from: &Chain) -> Result<(usize, usize), TfError> {
    for (i, (frame, _)) in from.frames.iter().enumerate() {
        if let Some(j) = to.frames.iter().position(|(other, _)| other == frame) {
            return Ok((j, i));
        }
    }
    if let Some(failure) = from.failure.clone().or_else(|| to.failure.clone()) {
        return Err(failure);
    }
    let root = |chain: &Chain| chain.frames.last().map(|f| f.0.clone()).unwrap_or_default();
    Err(TfError::NotConnected {
        target_frame: target.to_owned(),
        source_frame: source.to_owned(),
        target_root: root(to),
        source_root: root(from),
    })
}
