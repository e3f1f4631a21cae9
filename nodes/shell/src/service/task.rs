//! The task that answers a service.

use super::Server;
use crate::Stop;
use puffer_msgs::Service;

/// Answers requests with `handler`, one after the other, until `stop`. A handler that panics costs its own answer
/// only.
pub(crate) async fn answer_all<S, H, F>(server: Server<S>, mut handler: H, stop: Stop)
where
    S: Service,
    H: FnMut(S::Request) -> F + Send + 'static,
    F: Future<Output = S::Response> + Send + 'static,
{
    while let Some((call, request)) = stop.or(server.receive()).await {
        let mut work = tokio::spawn(handler(request));
        match stop.or(&mut work).await {
            Some(Ok(response)) => server.answer(&call, &response).await,
            Some(Err(error)) => tracing::error!("{}: no answer: {error}", server.name()),
            None => return work.abort(),
        }
    }
}
