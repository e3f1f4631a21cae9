//! A ROS 2 node.

mod bulk;
mod endpoints;
mod standard;
mod transforms;

use crate::clock::Clock;
use crate::dds::Dds;
use crate::names::Names;
use crate::params::Store;
use crate::{Diagnostics, RosArgs, ServiceMapping, Stamp, Stop, TfBroadcaster, TfBuffer, logging};
use anyhow::{Context, Result, anyhow};
use puffer_core::params::Parameters;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::mpsc::unbounded_channel;

/// Stamps that the transforms of a node reach back.
const TF_WINDOW: Duration = Duration::from_secs(60);

/// A ROS 2 node with parameters `P`; clones share it. The node ends when `stop` is set, or when the last clone is
/// dropped.
pub struct Node<P> {
    inner: Arc<Inner<P>>,
}

impl<P> Clone for Node<P> {
    fn clone(&self) -> Self {
        Self { inner: Arc::clone(&self.inner) }
    }
}

struct Inner<P> {
    names: Names,
    domain: u16,
    mapping: ServiceMapping,
    dds: Dds,
    clock: Clock,
    params: Arc<Store<P>>,
    stop: Stop,
    diagnostics: Diagnostics,
    tf: TfBuffer,
    tf_heard: Mutex<bool>,
    tf_sent: Mutex<Option<TfBroadcaster>>,
    _log: logging::Registration,
}

impl<P> Drop for Inner<P> {
    fn drop(&mut self) {
        self.stop.stop();
    }
}

impl<P: Parameters> Node<P> {
    /// Starts a node on a DDS participant of its own: parameter services, `/rosout`, `/diagnostics`, clock. Must be
    /// called inside a tokio runtime.
    ///
    /// # Errors
    /// A parameter for this node that is unknown or out of range, a name that is not allowed, or no network.
    pub async fn start(default_name: &str, args: RosArgs, stop: Stop) -> Result<Self> {
        let names = Names::new(default_name, &args.namespace, &args.remaps)?;
        let full = names.full();
        let clock = Clock::new();
        let params = Arc::new(Store::new(&full, &args.settings)?);
        let stop = stop.child();
        let (lines, queue) = unbounded_channel();
        let log_clock = clock.clone();
        let log =
            logging::register(&full, default_name, &args.logs, lines, move || log_clock.now());
        let dds = Dds::join(args.domain, names.namespace(), names.name(), &stop)
            .with_context(|| format!("node {full}"))?;
        let node = Self {
            inner: Arc::new(Inner {
                names,
                domain: args.domain,
                mapping: args.mapping,
                dds,
                clock,
                params,
                stop,
                diagnostics: Diagnostics::default(),
                tf: TfBuffer::new(TF_WINDOW),
                tf_heard: Mutex::new(false),
                tf_sent: Mutex::new(None),
                _log: log,
            }),
        };
        node.start_standard(queue, args.logs.rosout)?;
        Ok(node)
    }

    pub(crate) fn dds(&self) -> &Dds {
        &self.inner.dds
    }

    pub(crate) fn clock(&self) -> Clock {
        self.inner.clock.clone()
    }

    pub(crate) fn resolve(&self, name: &str) -> Result<String> {
        self.inner.names.resolve(name).with_context(|| format!("node {}", self.full_name()))
    }

    /// The parameters as they are now.
    pub fn params(&self) -> P {
        self.inner.params.params()
    }

    /// Resolves when parameters have changed since `seen`, with their new values.
    pub async fn params_changed(&self, seen: &P) -> P {
        self.inner.params.changed(seen).await
    }

    /// Lets nobody change these parameters (`group.field`) from now on.
    pub fn protect_params(&self, names: &[&str]) {
        self.inner.params.protect(names);
    }

    /// The node's name.
    pub fn name(&self) -> &str {
        self.inner.names.name()
    }

    /// The namespace, starting with a slash.
    pub fn namespace(&self) -> &str {
        self.inner.names.namespace()
    }

    /// Namespace and name.
    pub fn full_name(&self) -> String {
        self.inner.names.full()
    }

    /// The DDS domain.
    pub fn domain(&self) -> u16 {
        self.inner.domain
    }

    /// The flag that ends the node. Setting it ends this node only.
    pub fn stop(&self) -> Stop {
        self.inner.stop.clone()
    }

    /// Now: simulated time with `use_sim_time` (0 before the first `/clock`), else the system's.
    pub fn now(&self) -> Stamp {
        self.inner.clock.now()
    }

    /// Waits until [`Node::now`] has reached `stamp`.
    ///
    /// # Errors
    /// It has not within `deadline` (wall time).
    pub async fn wait_until(&self, stamp: Stamp, deadline: Duration) -> Result<()> {
        let clock = &self.inner.clock;
        let reached = async {
            if clock.is_simulated() {
                clock.reached(stamp).await;
            } else {
                let left = stamp.seconds_since(clock.now()).max(0.0);
                tokio::time::sleep(Duration::from_secs_f64(left)).await;
            }
        };
        tokio::time::timeout(deadline, reached).await.map_err(|_| {
            let source = if clock.is_simulated() { "/clock" } else { "the system's clock" };
            anyhow!(
                "{source} has not reached {stamp} within {:.1} s; it is at {}",
                deadline.as_secs_f64(),
                clock.now()
            )
        })
    }

    /// Waits until the time is known: at once without `use_sim_time`, else for the first `/clock`.
    ///
    /// # Errors
    /// Nobody has told the time within `deadline` (wall time).
    pub async fn wait_for_clock(&self, deadline: Duration) -> Result<()> {
        self.wait_until(Stamp::from_nanos(1), deadline).await
    }

    /// Whether time comes from `/clock`.
    pub fn is_time_simulated(&self) -> bool {
        self.inner.clock.is_simulated()
    }

    /// What this node tells on `/diagnostics`, once a second.
    pub fn diagnostics(&self) -> Diagnostics {
        self.inner.diagnostics.clone()
    }
}
