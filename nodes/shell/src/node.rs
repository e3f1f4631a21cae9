//! A ROS 2 node.

use crate::bulk::{BulkPublisher, BulkSubscription, Delivery, Mode};
use crate::clock::Clock;
use crate::dds::Dds;
use crate::names::Names;
use crate::params::{self, Store};
use crate::service::{Server, answer_all};
use crate::{
    Action, ActionClient, Client, Diagnostics, Goal, Interface, Outcome, Profile, Publisher,
    RosArgs, Service, ServiceMapping, Stamp, Stop, Subscription, TfBroadcaster, TfBuffer, action,
    logging, qos, tf,
};
use anyhow::{Context, Result, anyhow};
use puffer_core::params::Parameters;
use puffer_msgs::diagnostic_msgs::msg::DiagnosticArray;
use puffer_msgs::rcl_interfaces::msg::Log;
use puffer_msgs::rosgraph_msgs::msg;
use ros2_client::MessageTypeName;
use rustdds::policy::Durability;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tokio::sync::watch;

const DIAGNOSTICS_PERIOD: Duration = Duration::from_secs(1);
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
        node.start_services(queue, args.logs.rosout)?;
        Ok(node)
    }

    fn start_services(&self, lines: UnboundedReceiver<Log>, rosout: bool) -> Result<()> {
        let inner = &self.inner;
        if rosout {
            let latched = qos::events(Durability::TransientLocal);
            let out = Publisher::new(&inner.dds, &self.resolve("/rosout")?, &latched)?;
            tokio::spawn(send_lines(lines, out, inner.stop.clone()));
        }
        let out = self.publisher("/diagnostics", Profile::Standard)?;
        tokio::spawn(diagnose(
            inner.diagnostics.clone(),
            out,
            self.full_name(),
            inner.clock.clone(),
            inner.stop.clone(),
        ));
        let simulated = inner.params.watch_sim_time();
        inner.clock.simulate(*simulated.borrow());
        let topic = self.resolve("/clock")?;
        let time = Subscription::new(&inner.dds, &topic, &qos::clock(), inner.stop.clone())?;
        tokio::spawn(follow(time, simulated, inner.clock.clone()));
        let volatile = qos::events(Durability::Volatile);
        let events = Publisher::new(&inner.dds, &self.resolve("/parameter_events")?, &volatile)?;
        params::serve(self, &inner.params, inner.clock.clone(), events)
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

    /// A publisher; `topic` is relative, `~/private` or absolute, and remapped.
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn publisher<M: Interface>(&self, topic: &str, profile: Profile) -> Result<Publisher<M>> {
        Publisher::new(&self.inner.dds, &self.resolve(topic)?, &profile.policies())
    }

    /// A subscription; `topic` as in [`Node::publisher`].
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn subscribe<M: Interface>(
        &self,
        topic: &str,
        profile: Profile,
    ) -> Result<Subscription<M>> {
        let topic = self.resolve(topic)?;
        Subscription::new(&self.inner.dds, &topic, &profile.policies(), self.stop())
    }

    /// A publisher of samples of any size; `topic` as in [`Node::publisher`].
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn bulk_publisher(&self, topic: &str, mode: Mode) -> Result<BulkPublisher> {
        let topic = self.resolve(topic)?;
        Ok(self.inner.dds.with_ros2_node(|node| BulkPublisher::new(node, &topic, mode))??)
    }

    /// A subscription to what a [`BulkPublisher`] sends; `topic` as in [`Node::publisher`].
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn bulk_subscribe<M>(
        &self,
        topic: &str,
        delivery: Delivery,
    ) -> Result<BulkSubscription<M>> {
        let topic = self.resolve(topic)?;
        Ok(self
            .inner
            .dds
            .with_ros2_node(|node| BulkSubscription::new(node, &topic, delivery))??)
    }

    /// As [`Node::bulk_publisher`], and whole messages of type `M` for readers that know nothing of tiles (RViz,
    /// rosbag2, scripts): only while there are any, and only what the host's socket buffers carry.
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn bulk_publisher_for_all<M: Interface>(
        &self,
        topic: &str,
        mode: Mode,
    ) -> Result<BulkPublisher> {
        let publisher = self.bulk_publisher(topic, mode)?;
        let participant = self.inner.dds.participant();
        let kind = MessageTypeName::new(M::PACKAGE, M::NAME);
        Ok(publisher.with_whole_messages(participant, &kind, mode == Mode::Latched)?)
    }

    /// As [`Node::bulk_subscribe`], and whole messages from writers that know nothing of tiles (a sensor's driver,
    /// scripts).
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn bulk_subscribe_from_all<M: Interface>(
        &self,
        topic: &str,
        delivery: Delivery,
    ) -> Result<BulkSubscription<M>> {
        let subscription = self.bulk_subscribe::<M>(topic, delivery)?;
        let participant = self.inner.dds.participant();
        let kind = MessageTypeName::new(M::PACKAGE, M::NAME);
        Ok(subscription.with_plain_messages(participant, &kind)?)
    }

    /// Answers requests, one after the other, in a task of its own until the node stops.
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn serve<S, H, F>(&self, name: &str, handler: H) -> Result<()>
    where
        S: Service,
        H: FnMut(S::Request) -> F + Send + 'static,
        F: Future<Output = S::Response> + Send + 'static,
    {
        let inner = &self.inner;
        let server = Server::<S>::new(&inner.dds, inner.mapping, &self.resolve(name)?)?;
        tokio::spawn(answer_all(server, handler, self.stop()));
        Ok(())
    }

    /// A client of a service.
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn client<S: Service>(&self, name: &str) -> Result<Client<S>> {
        let inner = &self.inner;
        Client::new(&inner.dds, inner.mapping, inner.domain, &self.resolve(name)?, &inner.stop)
    }

    /// Answers goals until the node stops. `accept` says whether a goal is taken (`Err` with the reason, which is
    /// logged); `execute` runs in a task of its own for each accepted goal.
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn action_server<A, C, H, F>(&self, name: &str, accept: C, execute: H) -> Result<()>
    where
        A: Action,
        C: FnMut(&A::Goal) -> std::result::Result<(), String> + Send + 'static,
        H: FnMut(Goal<A>) -> F + Send + 'static,
        F: Future<Output = Outcome<A::Result>> + Send + 'static,
    {
        let inner = &self.inner;
        let place = action::Place {
            dds: &inner.dds,
            mapping: inner.mapping,
            domain: inner.domain,
            name: &self.resolve(name)?,
            clock: &inner.clock,
            stop: &inner.stop,
        };
        action::serve(place, accept, execute)
    }

    /// A client of an action.
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn action_client<A: Action>(&self, name: &str) -> Result<ActionClient<A>> {
        let inner = &self.inner;
        ActionClient::new(action::Place {
            dds: &inner.dds,
            mapping: inner.mapping,
            domain: inner.domain,
            name: &self.resolve(name)?,
            clock: &inner.clock,
            stop: &inner.stop,
        })
    }

    /// The transforms that this node hears and those that it sends itself, over the last 60 s of stamps; the first
    /// call subscribes `/tf` and `/tf_static`.
    ///
    /// # Errors
    /// No resources.
    pub fn tf(&self) -> Result<TfBuffer> {
        let inner = &self.inner;
        let mut heard = inner.tf_heard.lock().unwrap_or_else(PoisonError::into_inner);
        if !*heard {
            let topics = [&*self.resolve("/tf")?, &*self.resolve("/tf_static")?];
            tf::subscribe(&inner.dds, topics, &inner.tf, &inner.stop)?;
            *heard = true;
        }
        Ok(inner.tf.clone())
    }

    /// Publishes transforms.
    ///
    /// # Errors
    /// No resources.
    pub fn tf_broadcaster(&self) -> Result<TfBroadcaster> {
        let inner = &self.inner;
        let mut sent = inner.tf_sent.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(broadcaster) = &*sent {
            return Ok(broadcaster.clone());
        }
        let topics = [&*self.resolve("/tf")?, &*self.resolve("/tf_static")?];
        let broadcaster = TfBroadcaster::new(&inner.dds, topics, inner.tf.clone())?;
        Ok(sent.insert(broadcaster).clone())
    }

    /// What this node tells on `/diagnostics`, once a second.
    pub fn diagnostics(&self) -> Diagnostics {
        self.inner.diagnostics.clone()
    }
}

async fn send_lines(mut lines: UnboundedReceiver<Log>, out: Publisher<Log>, stop: Stop) {
    while let Some(Some(line)) = stop.or(lines.recv()).await {
        // A line about it would come here again; standard error has the line.
        let _ = out.publish(&line);
    }
}

async fn diagnose(
    diagnostics: Diagnostics,
    out: Publisher<DiagnosticArray>,
    node: String,
    clock: Clock,
    stop: Stop,
) {
    let mut ticks = tokio::time::interval(DIAGNOSTICS_PERIOD);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    while stop.or(ticks.tick()).await.is_some() {
        let mut message = diagnostics.message(&node);
        message.header.stamp = clock.now().into();
        if let Err(error) = out.publish(&message) {
            tracing::debug!("{error:#}");
        }
    }
}

async fn follow(
    mut messages: Subscription<msg::Clock>,
    mut simulated: watch::Receiver<bool>,
    clock: Clock,
) {
    loop {
        tokio::select! {
            message = messages.next() => match message {
                Some(message) => clock.set(message.clock.into()),
                None => return,
            },
            changed = simulated.changed() => match changed {
                Ok(()) => clock.simulate(*simulated.borrow()),
                Err(_) => return,
            },
        }
    }
}
