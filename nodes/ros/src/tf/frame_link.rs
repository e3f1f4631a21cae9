//! The parents and poses of one frame over time.

use super::{TfError, Transform};
use crate::Stamp;
use puffer_core::geometry::Pose;
use std::collections::BTreeMap;
use std::time::Duration;

/// A parent frame, and the pose of the child in it.
#[derive(Clone, Debug)]
pub(crate) struct ParentPose {
    pub parent: String,
    pub pose: Pose,
}

/// How a frame is linked to its parent over time.
#[derive(Clone, Debug)]
pub(crate) enum FrameLink {
    /// At all times in the same way.
    Static(ParentPose),
    /// At these stamps; never empty.
    Moving(BTreeMap<Stamp, ParentPose>),
}

impl FrameLink {
    /// The frame of a transform, and its link.
    pub fn new(transform: Transform, is_static: bool) -> (String, Self) {
        let sample = ParentPose { parent: transform.parent, pose: transform.pose };
        let link = if is_static {
            FrameLink::Static(sample)
        } else {
            FrameLink::Moving(BTreeMap::from([(transform.stamp, sample)]))
        };
        (transform.child, link)
    }

    /// Takes over the samples of `newer`. Samples of a static link are not mixed with those of a
    /// moving one, and stamps that jump back by more than `window` mean that time began anew (a
    /// simulation or bag was restarted): then the older samples are forgotten.
    pub fn update(&mut self, newer: FrameLink, window: Duration) {
        let restarted = match (&*self, &newer) {
            (FrameLink::Moving(old), FrameLink::Moving(new)) => {
                match (old.keys().last(), new.keys().last()) {
                    (Some(old), Some(new)) => *new < *old - window,
                    _ => true,
                }
            }
            _ => true,
        };
        match (self, newer) {
            (FrameLink::Moving(old), FrameLink::Moving(new)) if !restarted => {
                old.extend(new);
                let oldest = old.keys().last().copied().unwrap_or_default() - window;
                while old.first_key_value().is_some_and(|(stamp, _)| *stamp < oldest) {
                    old.pop_first();
                }
            }
            (this, newer) => *this = newer,
        }
    }

    /// The newest sample and its stamp; a static link has no stamp.
    pub fn newest(&self) -> Option<(Option<Stamp>, &ParentPose)> {
        match self {
            FrameLink::Static(sample) => Some((None, sample)),
            FrameLink::Moving(samples) => {
                samples.iter().last().map(|(at, sample)| (Some(*at), sample))
            }
        }
    }

    /// Parent and pose at a stamp. Between samples of two parents the earlier one holds; `child` is
    /// the frame's name, for errors.
    pub fn at(&self, child: &str, stamp: Stamp) -> Result<ParentPose, TfError> {
        let samples = match self {
            FrameLink::Static(sample) => return Ok(sample.clone()),
            FrameLink::Moving(samples) => samples,
        };
        let before = samples.range(..=stamp).next_back();
        let after = samples.range(stamp..).next();
        match (before, after) {
            (Some((at, sample)), _) if *at == stamp => Ok(sample.clone()),
            (Some((from, a)), Some((to, b))) if a.parent == b.parent => {
                let fraction = stamp.seconds_since(*from) / to.seconds_since(*from);
                Ok(ParentPose {
                    parent: a.parent.clone(),
                    pose: interpolate(&a.pose, &b.pose, fraction),
                })
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
    samples: &BTreeMap<Stamp, ParentPose>,
    nearest: &ParentPose,
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

/// Below this sine of the angle between two rotations they have no axis between them.
const MIN_SLERP_SINE: f64 = 1e-9;

/// The pose at `fraction` of the way from `a` to `b`: linear for the position, spherical linear
/// (the shorter way) for the rotation. Of rotations that are too close for that, the nearer one
/// holds.
fn interpolate(a: &Pose, b: &Pose, fraction: f64) -> Pose {
    let rotation = a.rotation.try_slerp(&b.rotation, fraction, MIN_SLERP_SINE);
    let nearer = if fraction < 0.5 { a.rotation } else { b.rotation };
    Pose::from_parts(
        a.translation.vector.lerp(&b.translation.vector, fraction).into(),
        rotation.unwrap_or(nearer),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOW: Duration = Duration::from_secs(10);

    fn link(second: f64, parent: &str, x: f64) -> FrameLink {
        let pose = Pose::translation(x, 0.0, 0.0);
        let stamp = Stamp::from_seconds(second);
        let transform = Transform { parent: parent.into(), child: "child".into(), stamp, pose };
        FrameLink::new(transform, false).1
    }

    fn position(link: &FrameLink, second: f64) -> f64 {
        link.at("child", Stamp::from_seconds(second)).unwrap().pose.translation.x
    }

    #[test]
    fn positions_are_interpolated_between_neighbours() {
        let mut moving = link(1.0, "a", 10.0);
        moving.update(link(3.0, "a", 20.0), WINDOW);
        moving.update(link(2.0, "a", 12.0), WINDOW);
        assert_eq!([1.0, 1.5, 2.0, 2.25].map(|at| position(&moving, at)), [10.0, 11.0, 12.0, 14.0]);
        assert_eq!(moving.newest().unwrap().0, Some(Stamp::from_seconds(3.0)));
    }

    #[test]
    fn a_jump_back_beyond_the_window_forgets_what_was_before() {
        let mut moving = link(20.0, "a", 1.0);
        moving.update(link(10.0, "a", 2.0), WINDOW);
        assert_eq!(position(&moving, 15.0), 1.5, "exactly the window is a late sample");
        moving.update(link(9.0, "a", 3.0), WINDOW);
        assert_eq!(moving.newest().unwrap().0, Some(Stamp::from_seconds(9.0)));
    }

    #[test]
    fn a_static_link_holds_always_and_replaces_a_moving_one() {
        let mut moving = link(20.0, "a", 1.0);
        let FrameLink::Moving(samples) = link(0.0, "b", 7.0) else { panic!("a moving link") };
        let fixed = FrameLink::Static(samples[&Stamp::ZERO].clone());
        moving.update(fixed, WINDOW);
        assert_eq!([-5.0, 0.0, 1e6].map(|at| position(&moving, at)), [7.0; 3]);
        assert_eq!(moving.newest().unwrap().0, None);
    }
}
