//! A ROS 2 node.

mod endpoints;
mod large_data_endpoints;
mod standard;
mod transforms;

use crate::clock::Clock;
use crate::dds::Participant;
use crate::names::Names;
use crate::params::ParameterStore;
use crate::{Diagnostics, RosArgs, ServiceMapping, Stamp, Stop, TfBroadcaster, TfBuffer, logging};
use anyhow::{Context, Result, anyhow};
use puffer_core::params::Parameters;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::mpsc::unbounded_channel;

/// How long a node keeps transforms.
const TF_WINDOW: Duration = Duration::from_secs(60);

/// A ROS 2 node with parameters `P`, on a DDS participant of its own. Clones share the node. It
/// ends when its [`Stop`] flag is set, or when the last clone is dropped.
///
/// Names of topics, services and actions are relative ("points"), private ("~/status") or absolute
/// ("/clock"), and are remapped by the node's arguments.
///
/// ```no_run
/// use puffer_msgs::std_srvs::srv::{SetBool, SetBoolResponse};
/// use puffer_ros::{NoParams, Node, RosArgs, Stop};
///
/// # async fn run(stop: Stop) -> anyhow::Result<()> {
/// let args = RosArgs::default().with_domain(42);
/// let node = Node::<NoParams>::start("light", args, stop).await?;
/// node.serve::<SetBool, _, _>("~/switch", |request| async move {
///     SetBoolResponse { success: true, message: format!("on: {}", request.data) }
/// })?;
/// node.stop().stopped().await;
/// # Ok(())
/// # }
/// ```
pub struct Node<P> {
    inner: Arc<NodeState<P>>,
}

impl<P> Clone for Node<P> {
    fn clone(&self) -> Self {
        Self { inner: Arc::clone(&self.inner) }
    }
}

/// What the clones of a node share.
struct NodeState<P> {
    names: Names,
    domain: u16,
    mapping: ServiceMapping,
    dds: Participant,
    clock: Clock,
    params: Arc<ParameterStore<P>>,
    stop: Stop,
    diagnostics: Diagnostics,
    tf: TfBuffer,
    /// Whether `/tf` and `/tf_static` are subscribed to.
    is_tf_subscribed: Mutex<bool>,
    tf_broadcaster: Mutex<Option<TfBroadcaster>>,
    _log: logging::Registration,
}

impl<P> Drop for NodeState<P> {
    fn drop(&mut self) {
        self.stop.stop();
    }
}

impl<P: Parameters> Node<P> {
    /// Starts a node with its parameter services, `/rosout`, `/diagnostics` and clock. Must be
    /// called inside a tokio runtime.
    ///
    /// # Errors
    /// A parameter for this node that is unknown or out of range, a name that is not allowed, or no
    /// network.
    pub async fn start(default_name: &str, args: RosArgs, stop: Stop) -> Result<Self> {
        let names = Names::new(default_name, &args.namespace, &args.remaps)?;
        let full = names.full();
        let clock = Clock::new();
        let params = Arc::new(ParameterStore::new(&full, &args.settings)?);
        let stop = stop.child();
        let (lines, queue) = unbounded_channel();
        let log_clock = clock.clone();
        let log =
            logging::register(&full, default_name, &args.logs, lines, move || log_clock.now());
        let dds = Participant::join(args.domain, names.namespace(), names.name(), &stop)
            .with_context(|| format!("node {full}"))?;
        let node = Self {
            inner: Arc::new(NodeState {
                names,
                domain: args.domain,
                mapping: args.mapping,
                dds,
                clock,
                params,
                stop,
                diagnostics: Diagnostics::default(),
                tf: TfBuffer::new(TF_WINDOW),
                is_tf_subscribed: Mutex::new(false),
                tf_broadcaster: Mutex::new(None),
                _log: log,
            }),
        };
        node.start_standard(queue, args.logs.rosout)?;
        Ok(node)
    }

    pub(crate) fn dds(&self) -> &Participant {
        &self.inner.dds
    }

    pub(crate) fn clock(&self) -> Clock {
        self.inner.clock.clone()
    }

    /// The absolute name after remapping.
    pub(crate) fn resolve(&self, name: &str) -> Result<String> {
        self.inner.names.resolve(name).with_context(|| format!("node {}", self.full_name()))
    }

    /// The present values of the parameters.
    pub fn params(&self) -> P {
        self.inner.params.params()
    }

    /// Waits until the values of the parameters differ from `seen`; returns them.
    pub async fn params_changed(&self, seen: &P) -> P {
        self.inner.params.changed(seen).await
    }

    /// Makes these parameters (`group.field`) read-only from now on.
    pub fn protect_params(&self, names: &[&str]) {
        self.inner.params.protect(names);
    }

    /// The node's name.
    pub fn name(&self) -> &str {
        self.inner.names.name()
    }

    /// The node's namespace; it starts with a slash.
    pub fn namespace(&self) -> &str {
        self.inner.names.namespace()
    }

    /// The node's namespace and name.
    pub fn full_name(&self) -> String {
        self.inner.names.full()
    }

    /// The DDS domain.
    pub fn domain(&self) -> u16 {
        self.inner.domain
    }

    /// The flag that ends the node; setting it ends this node only.
    pub fn stop(&self) -> Stop {
        self.inner.stop.clone()
    }

    /// The time: with `use_sim_time` that of `/clock` (0 before its first message), else that of
    /// the system's clock.
    pub fn now(&self) -> Stamp {
        self.inner.clock.now()
    }

    /// Waits until [`Node::now`] reaches `stamp`.
    ///
    /// # Errors
    /// If it does not within `deadline` (wall time).
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

    /// Waits until the time is known: with `use_sim_time` for the first message on `/clock`, else
    /// not at all.
    ///
    /// # Errors
    /// If nobody publishes `/clock` within `deadline` (wall time).
    pub async fn wait_for_clock(&self, deadline: Duration) -> Result<()> {
        self.wait_until(Stamp::from_nanos(1), deadline).await
    }

    /// Whether the time comes from `/clock`.
    pub fn is_time_simulated(&self) -> bool {
        self.inner.clock.is_simulated()
    }

    /// What this node tells of itself on `/diagnostics`, once a second.
    pub fn diagnostics(&self) -> Diagnostics {
        self.inner.diagnostics.clone()
    }
}
