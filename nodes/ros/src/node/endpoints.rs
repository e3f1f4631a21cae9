//! Topics, services and actions.

use super::{Node, NodeState};
use crate::service::{Server, answer_all};
use crate::{
    Action, ActionClient, Client, Goal, Interface, Outcome, Publisher, QosProfile, Service,
    Subscription, action,
};
use anyhow::Result;
use puffer_core::params::Parameters;
use std::time::Duration;

impl<P> NodeState<P> {
    /// What the endpoints of the action with the absolute name `name` are made from.
    fn action_context<'a>(&'a self, name: &'a str) -> action::ActionContext<'a> {
        action::ActionContext {
            dds: &self.dds,
            mapping: self.mapping,
            domain: self.domain,
            name,
            clock: &self.clock,
            stop: &self.stop,
        }
    }
}

impl<P: Parameters> Node<P> {
    /// A publisher of ordinary samples.
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
    pub fn publisher<M: Interface>(
        &self,
        topic: &str,
        profile: QosProfile,
    ) -> Result<Publisher<M>> {
        Publisher::new(&self.inner.dds, &self.resolve(topic)?, &profile.policies())
    }

    /// A subscription to ordinary samples.
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
    pub fn subscribe<M: Interface>(
        &self,
        topic: &str,
        profile: QosProfile,
    ) -> Result<Subscription<M>> {
        let topic = self.resolve(topic)?;
        Subscription::new(&self.inner.dds, &topic, &profile.policies(), self.stop())
    }

    /// Serves the service `S`: `handler` answers requests, one after the other, in a task of its
    /// own until the node stops.
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
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

    /// A client of the service `S`.
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
    pub fn client<S: Service>(&self, name: &str) -> Result<Client<S>> {
        let inner = &self.inner;
        Client::new(&inner.dds, inner.mapping, inner.domain, &self.resolve(name)?, &inner.stop)
    }

    /// Serves the action `A` until the node stops. `accept` decides whether a goal is accepted
    /// (`Err` with the reason, which is logged, if not); `execute` runs in a task of its own for
    /// each accepted goal and returns how it ended.
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
    pub fn action_server<A, C, H, F>(&self, name: &str, accept: C, execute: H) -> Result<()>
    where
        A: Action,
        C: FnMut(&A::Goal) -> std::result::Result<(), String> + Send + 'static,
        H: FnMut(Goal<A>) -> F + Send + 'static,
        F: Future<Output = Outcome<A::Result>> + Send + 'static,
    {
        let inner = &self.inner;
        let name = self.resolve(name)?;
        action::serve(inner.action_context(&name), accept, execute)
    }

    /// A client of the action `A`.
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
    pub fn action_client<A: Action>(&self, name: &str) -> Result<ActionClient<A>> {
        let name = self.resolve(name)?;
        ActionClient::new(self.inner.action_context(&name))
    }

    /// Waits until `probe` returns `Ok`, and returns what it found. `probe` is called at once, and
    /// again after each change of the remote endpoints that match this node's: [`Client::is_ready`]
    /// changes with them.
    ///
    /// # Errors
    /// After `deadline` (wall time) the newest error of `probe`, which names what is still missing.
    pub async fn wait_for_matches<R, E>(
        &self,
        deadline: Duration,
        mut probe: impl FnMut() -> std::result::Result<R, E>,
    ) -> std::result::Result<R, E> {
        let mut newest = probe();
        let matched = self.inner.dds.matches().wait(|_| {
            newest = probe();
            newest.is_ok()
        });
        // After the deadline the newest error says what is missing.
        let _ = tokio::time::timeout(deadline, matched).await;
        newest
    }
}
