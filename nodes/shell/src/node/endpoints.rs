//! Topics, services and actions.

use super::Node;
use crate::service::{Server, answer_all};
use crate::{
    Action, ActionClient, Client, Goal, Interface, Outcome, Profile, Publisher, Service,
    Subscription, action,
};
use anyhow::Result;
use puffer_core::params::Parameters;

impl<P: Parameters> Node<P> {
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
}
