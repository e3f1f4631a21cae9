//! The transforms of one child frame over time.

use super::{TfError, Transform};
use crate::Stamp;
use puffer_core::geometry::Pose;
use std::collections::BTreeMap;
use std::time::Duration;

/// A parent, and the pose of the child in it.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    pub parent: String,
    pub pose: Pose,
}

/// How a child frame hangs on its parent.
#[derive(Clone, Debug)]
pub(crate) enum Link {
    /// At all times.
    Static(Sample),
    /// At the stamps; never empty.
    Moving(BTreeMap<Stamp, Sample>),
}

impl Link {
    pub fn new(transform: Transform, is_static: bool) -> (String, Self) {
        let sample = Sample { parent: transform.parent, pose: transform.pose };
        let link = if is_static {
            Link::Static(sample)
        } else {
            Link::Moving(BTreeMap::from([(transform.stamp, sample)]))
        };
        (transform.child, link)
    }

    /// Takes over what `newer` holds. Samples of a fixed link are not mixed with those of a moving one, and stamps that
    /// jump back by more than the window mean that time began anew (a simulation or bag was restarted).
    pub fn update(&mut self, newer: Link, window: Duration) {
        let restarted = match (&*self, &newer) {
            (Link::Moving(old), Link::Moving(new)) => {
                match (old.keys().last(), new.keys().last()) {
                    (Some(old), Some(new)) => *new < *old - window,
                    _ => true,
                }
            }
            _ => true,
        };
        match (self, newer) {
            (Link::Moving(old), Link::Moving(new)) if !restarted => {
                old.extend(new);
                let oldest = old.keys().last().copied().unwrap_or_default() - window;
                while old.first_key_value().is_some_and(|(stamp, _)| *stamp < oldest) {
                    old.pop_first();
                }
            }
            (this, newer) => *this = newer,
        }
    }

    /// Stamp of the newest sample and its parent; no stamp for a fixed link.
    pub fn newest(&self) -> Option<(Option<Stamp>, &Sample)> {
        match self {
            Link::Static(sample) => Some((None, sample)),
            Link::Moving(samples) => samples.iter().last().map(|(at, sample)| (Some(*at), sample)),
        }
    }

    /// Parent and pose at the stamp. Between samples of two parents, the earlier one holds.
    pub fn at(&self, child: &str, stamp: Stamp) -> Result<Sample, TfError> {
        let samples = match self {
            Link::Static(sample) => return Ok(sample.clone()),
            Link::Moving(samples) => samples,
        };
        let before = samples.range(..=stamp).next_back();
        let after = samples.range(stamp..).next();
        match (before, after) {
            (Some((at, sample)), _) if *at == stamp => Ok(sample.clone()),
            (Some((from, a)), Some((to, b))) if a.parent == b.parent => {
                let share = stamp.seconds_since(*from) / to.seconds_since(*from);
                Ok(Sample { parent: a.parent.clone(), pose: between(&a.pose, &b.pose, share) })
            }
            (Some((_, sample)), Some(_)) => Ok(sample.clone()),
            (Some((newest, sample)), None) => {
                let late = stamp.seconds_since(*newest);
                let outside = format!("{late:.3} s after the newest");
                Err(out_of_range(samples, sample, child, stamp, outside))
            }
            (None, Some((oldest, sample))) => {
                let early = oldest.seconds_since(stamp);
                let outside = format!("{early:.3} s before the oldest");
                Err(out_of_range(samples, sample, child, stamp, outside))
            }
            (None, None) => {
                Err(TfError::UnknownFrame { frame: child.to_owned(), known: String::new() })
            }
        }
    }
}

fn out_of_range(
    samples: &BTreeMap<Stamp, Sample>,
    nearest: &Sample,
    child: &str,
    stamp: Stamp,
    outside: String,
) -> TfError {
    TfError::OutOfRange {
        parent: nearest.parent.clone(),
        child: child.to_owned(),
        stamp,
        outside,
        count: samples.len(),
        oldest: samples.keys().next().copied().unwrap_or_default(),
        newest: samples.keys().last().copied().unwrap_or_default(),
    }
}

/// Linear for the position, spherical linear (the shorter way) for the rotation. Rotations closer than a billionth have
/// no axis between them: the nearer one holds.
fn between(a: &Pose, b: &Pose, share: f64) -> Pose {
    let rotation = a.rotation.try_slerp(&b.rotation, share, 1e-9);
    let nearer = if share < 0.5 { a.rotation } else { b.rotation };
    Pose::from_parts(
        a.translation.vector.lerp(&b.translation.vector, share).into(),
        rotation.unwrap_or(nearer),
    )
}
