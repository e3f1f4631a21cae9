//! A tree of frames over time.

use super::{TfError, Transform};
use crate::Stamp;
use puffer_core::geometry::Pose;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::watch;

/// Stamps kept for each link where nothing else is asked.
const WINDOW: Duration = Duration::from_secs(10);
/// Longer chains are taken for a loop.
const DEPTH: usize = 1000;

/// Transforms of the last seconds; clones share it. Needs no node: a bag's transforms may be inserted.
#[derive(Clone, Debug)]
pub struct TfBuffer {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    window: Duration,
    links: Mutex<BTreeMap<String, Link>>,
    changed: watch::Sender<u64>,
}

/// How a frame hangs on its parent.
#[derive(Debug)]
struct Link {
    parent: String,
    /// `parent_from_child`; one only, for all times, if static.
    samples: BTreeMap<Stamp, Pose>,
    is_static: bool,
}

impl Default for TfBuffer {
    /// Keeps 10 s of stamps.
    fn default() -> Self {
        Self::new(WINDOW)
    }
}

type Links = BTreeMap<String, Link>;

impl TfBuffer {
    /// A buffer that keeps the last `window` of stamps for each frame.
    pub fn new(window: Duration) -> Self {
        let changed = watch::Sender::new(0);
        Self { shared: Arc::new(Shared { window, links: Mutex::default(), changed }) }
    }

    fn links(&self) -> MutexGuard<'_, Links> {
        self.shared.links.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a transform; a static one holds for all times. A frame whose parent changes forgets its past. What
    /// is older than the window is left out.
    pub fn insert(&self, transform: Transform, is_static: bool) {
        let Transform { parent, child, stamp, pose } = transform;
        {
            let mut links = self.links();
            let link = links.entry(name_of(&child).to_owned()).or_insert_with(|| Link {
                parent: String::new(),
                samples: BTreeMap::new(),
                is_static,
            });
            if link.parent != name_of(&parent) || is_static || link.is_static {
                link.samples.clear();
                link.is_static = is_static;
                name_of(&parent).clone_into(&mut link.parent);
            }
            link.samples.insert(stamp, pose);
            if let Some(newest) = link.samples.last_key_value().map(|(stamp, _)| *stamp) {
                link.samples = link.samples.split_off(&(newest - self.shared.window));
            }
        }
        self.shared.changed.send_modify(|count| *count += 1);
    }

    /// Forgets everything, as when simulated time starts again.
    pub fn clear(&self) {
        self.links().clear();
        self.shared.changed.send_modify(|count| *count += 1);
    }

    /// `target_from_source` at `stamp`: a sample itself where one has that stamp, else between its neighbours
    /// (linear, and spherical linear for the rotation). Nothing is extrapolated.
    ///
    /// # Errors
    /// See [`TfError`].
    pub fn lookup(&self, target: &str, source: &str, stamp: Stamp) -> Result<Pose, TfError> {
        let (target, source) = (name_of(target), name_of(source));
        let links = self.links();
        let (target_chain, source_chain) = (chain(&links, target)?, chain(&links, source)?);
        let common = common(&target_chain, &source_chain)?;
        let common_from_target = compose(&links, &target_chain, common, stamp)?;
        let common_from_source = compose(&links, &source_chain, common, stamp)?;
        Ok(match common_from_target {
            None => common_from_source.unwrap_or_else(Pose::identity),
            Some(target) => match common_from_source {
                None => target.inverse(),
                Some(source) => target.inverse() * source,
            },
        })
    }

    /// `target_from_source` at the newest stamp at which it is known, with that stamp ([`Stamp::ZERO`] where all
    /// links are static).
    ///
    /// # Errors
    /// See [`TfError`].
    pub fn latest(&self, target: &str, source: &str) -> Result<(Pose, Stamp), TfError> {
        let stamp = {
            let links = self.links();
            let chains = [chain(&links, name_of(target))?, chain(&links, name_of(source))?];
            let common = common(&chains[0], &chains[1])?;
            let moving = chains
                .iter()
                .flat_map(|chain| chain.iter().take_while(|frame| **frame != common))
                .filter_map(|frame| links.get(*frame).filter(|link| !link.is_static));
            moving
                .filter_map(|link| link.samples.last_key_value().map(|(stamp, _)| *stamp))
                .min()
                .unwrap_or_default()
        };
        Ok((self.lookup(target, source, stamp)?, stamp))
    }

    /// As [`TfBuffer::lookup`], but waits until the transform is known.
    ///
    /// # Errors
    /// [`TfError::Deadline`] after `deadline` of wall time; at once if the stamp is older than what is kept.
    pub async fn wait(
        &self,
        target: &str,
        source: &str,
        stamp: Stamp,
        deadline: Duration,
    ) -> Result<Pose, TfError> {
        let until = tokio::time::Instant::now() + deadline;
        let mut changes = self.shared.changed.subscribe();
        loop {
            changes.borrow_and_update();
            let reason = match self.lookup(target, source, stamp) {
                Ok(pose) => return Ok(pose),
                Err(reason) => reason,
            };
            if let TfError::OutOfRange { oldest, .. } = &reason
                && stamp < *oldest
            {
                return Err(reason);
            }
            if tokio::time::timeout_at(until, changes.changed()).await.is_err() {
                return Err(TfError::Deadline {
                    target_frame: target.to_owned(),
                    source_frame: source.to_owned(),
                    deadline,
                    reason: Box::new(reason),
                });
            }
        }
    }
}

/// tf2 forbids a leading slash, tf had it.
fn name_of(frame: &str) -> &str {
    frame.strip_prefix('/').unwrap_or(frame)
}

/// The frame and all above it.
fn chain<'a>(links: &'a Links, frame: &'a str) -> Result<Vec<&'a str>, TfError> {
    let known = links.contains_key(frame) || links.values().any(|link| link.parent == frame);
    if !known {
        let mut all: Vec<_> =
            links.iter().flat_map(|(child, link)| [child.as_str(), link.parent.as_str()]).collect();
        all.sort_unstable();
        all.dedup();
        let known = if all.is_empty() { "none".to_owned() } else { all.join(", ") };
        return Err(TfError::UnknownFrame { frame: frame.to_owned(), known });
    }
    let mut chain = vec![frame];
    while let Some(link) = chain.last().and_then(|last| links.get(*last)) {
        if chain.len() > DEPTH || chain.contains(&link.parent.as_str()) {
            return Err(TfError::Loop { frame: frame.to_owned(), parent: link.parent.clone() });
        }
        chain.push(&link.parent);
    }
    Ok(chain)
}

fn common<'a>(target: &[&'a str], source: &[&'a str]) -> Result<&'a str, TfError> {
    target.iter().find(|frame| source.contains(frame)).copied().ok_or_else(|| {
        let first = |chain: &[&str]| chain.first().copied().unwrap_or_default().to_owned();
        let last = |chain: &[&str]| chain.last().copied().unwrap_or_default().to_owned();
        TfError::NotConnected {
            target_frame: first(target),
            source_frame: first(source),
            target_root: last(target),
            source_root: last(source),
        }
    })
}

/// `ancestor_from_first`; `None` if they are the same frame, so that one link alone is not multiplied by an identity.
fn compose(
    links: &Links,
    chain: &[&str],
    ancestor: &str,
    stamp: Stamp,
) -> Result<Option<Pose>, TfError> {
    let mut pose: Option<Pose> = None;
    for frame in chain.iter().take_while(|frame| **frame != ancestor) {
        if let Some(link) = links.get(*frame) {
            let step = link.at(frame, stamp)?;
            pose = Some(pose.map_or(step, |below| step * below));
        }
    }
    Ok(pose)
}

impl Link {
    fn at(&self, child: &str, stamp: Stamp) -> Result<Pose, TfError> {
        if let Some(pose) = self.samples.get(&stamp) {
            return Ok(*pose);
        }
        let before = self.samples.range(..stamp).next_back();
        let after = self.samples.range(stamp..).next();
        match (before, after) {
            (Some((_, pose)), _) | (_, Some((_, pose))) if self.is_static => Ok(*pose),
            (Some((from, a)), Some((to, b))) => {
                let share = stamp.seconds_since(*from) / to.seconds_since(*from);
                Ok(between(a, b, share))
            }
            _ => Err(self.out_of_range(child, stamp)),
        }
    }

    fn out_of_range(&self, child: &str, stamp: Stamp) -> TfError {
        let oldest = self.samples.first_key_value().map(|(at, _)| *at).unwrap_or_default();
        let newest = self.samples.last_key_value().map(|(at, _)| *at).unwrap_or_default();
        let outside = if stamp < oldest {
            format!("{:.3} s before the oldest", oldest.seconds_since(stamp))
        } else {
            format!("{:.3} s after the newest", stamp.seconds_since(newest))
        };
        TfError::OutOfRange {
            parent: self.parent.clone(),
            child: child.to_owned(),
            stamp,
            outside,
            count: self.samples.len(),
            oldest,
            newest,
        }
    }
}

fn between(a: &Pose, b: &Pose, share: f64) -> Pose {
    let translation = a.translation.vector.lerp(&b.translation.vector, share);
    // Opposite rotations have no shortest way between them; then the nearer one.
    let rotation = a.rotation.try_slerp(&b.rotation, share, 1e-12).unwrap_or(if share < 0.5 {
        a.rotation
    } else {
        b.rotation
    });
    Pose::from_parts(translation.into(), rotation)
}
