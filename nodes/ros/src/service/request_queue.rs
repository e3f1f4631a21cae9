//! The queue between the task that receives the requests of a service and the one that answers
//! them.

use super::{Call, Server};
use crate::Stop;
use puffer_msgs::Service;
use std::sync::Arc;
use tokio::sync::mpsc::{Sender, channel};

/// Number of requests that wait for their turn; further ones wait in DDS.
const MAX_WAITING_REQUESTS: usize = 256;

/// Answers requests with `handler`, one after the other, until `stop`. A handler that panics costs
/// its own answer only. Requests are received while a handler works, however long that takes,
/// because DDS keeps only a few.
pub(crate) async fn answer_all<S, H, F>(server: Server<S>, mut handler: H, stop: Stop)
where
    S: Service,
    H: FnMut(S::Request) -> F + Send + 'static,
    F: Future<Output = S::Response> + Send + 'static,
{
    let server = Arc::new(server);
    let (sender, mut waiting) = channel(MAX_WAITING_REQUESTS);
    tokio::spawn(receive_requests(Arc::clone(&server), sender, stop.clone()));
    while let Some(Some((call, request))) = stop.or(waiting.recv()).await {
        let mut work = tokio::spawn(handler(request));
        match stop.or(&mut work).await {
            Some(Ok(response)) => server.answer(&call, &response).await,
            Some(Err(error)) => tracing::error!("{}: no answer: {error}", server.name()),
            None => return work.abort(),
        }
    }
}

/// Receives requests and queues them.
async fn receive_requests<S: Service>(
    server: Arc<Server<S>>,
    queue: Sender<(Call, S::Request)>,
    stop: Stop,
) {
    while let Some(request) = stop.or(server.receive()).await {
        // Fails only when the node stops.
        if stop.or(queue.send(request)).await.is_none_or(|sent| sent.is_err()) {
            return;
        }
    }
}
