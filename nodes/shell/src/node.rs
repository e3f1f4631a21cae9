//! A ROS 2 node.

use crate::{
    Action, ActionClient, Client, Diagnostics, Goal, Message, Outcome, Profile, Publisher, RosArgs,
    Service, Stamp, Stop, Subscription, TfBroadcaster, TfBuffer,
};
use anyhow::{Result, bail};
use puffer_core::params::Parameters;
use std::marker::PhantomData;

/// A ROS 2 node with parameters `P`; clones share it. The node ends when `stop` is set.
#[derive(Clone)]
pub struct Node<P> {
    params: PhantomData<P>,
}

impl<P: Parameters> Node<P> {
    /// Starts a node on a DDS participant of its own: parameter services, `/rosout`, `/diagnostics`, clock.
    ///
    /// # Errors
    /// A parameter for this node that is unknown or out of range, a name that is not allowed, or no network.
    pub async fn start(default_name: &str, args: RosArgs, stop: Stop) -> Result<Self> {
        bail!("not yet: {default_name} {} {stop:?}", args.domain())
    }

    /// The parameters as they are now.
    pub fn params(&self) -> P {
        P::default()
    }

    /// Resolves when parameters have changed since `seen`, with their new values.
    pub async fn params_changed(&self, seen: &P) -> P {
        seen.clone()
    }

    /// The node's name.
    pub fn name(&self) -> &str {
        ""
    }

    /// The namespace, starting with a slash.
    pub fn namespace(&self) -> &str {
        ""
    }

    /// The DDS domain.
    pub fn domain(&self) -> u16 {
        0
    }

    /// The flag that ends the node.
    pub fn stop(&self) -> Stop {
        Stop::new()
    }

    /// Now: simulated time with `use_sim_time` (0 before the first `/clock`), else the system's.
    pub fn now(&self) -> Stamp {
        Stamp::ZERO
    }

    /// A publisher; `topic` is relative, `~/private` or absolute, and remapped.
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn publisher<M: Message>(&self, topic: &str, profile: Profile) -> Result<Publisher<M>> {
        bail!("not yet: {topic} {profile:?}")
    }

    /// A subscription; `topic` as in [`Node::publisher`].
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn subscribe<M: Message>(&self, topic: &str, profile: Profile) -> Result<Subscription<M>> {
        bail!("not yet: {topic} {profile:?}")
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
        let _ = handler;
        bail!("not yet: {name}")
    }

    /// A client of a service.
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn client<S: Service>(&self, name: &str) -> Result<Client<S>> {
        bail!("not yet: {name}")
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
        let _ = (accept, execute);
        bail!("not yet: {name}")
    }

    /// A client of an action.
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn action_client<A: Action>(&self, name: &str) -> Result<ActionClient<A>> {
        bail!("not yet: {name}")
    }

    /// The transforms that this node hears; the first call subscribes `/tf` and `/tf_static`.
    ///
    /// # Errors
    /// No resources.
    pub fn tf(&self) -> Result<TfBuffer> {
        bail!("not yet")
    }

    /// Publishes transforms.
    ///
    /// # Errors
    /// No resources.
    pub fn tf_broadcaster(&self) -> Result<TfBroadcaster> {
        bail!("not yet")
    }

    /// What this node tells on `/diagnostics`, once a second.
    pub fn diagnostics(&self) -> Diagnostics {
        Diagnostics::default()
    }
}
