//! The tasks that answer a service.

use super::{Call, Server};
use crate::Stop;
use puffer_msgs::Service;
use std::sync::Arc;
use tokio::sync::mpsc::{Sender, channel};

/// Requests that wait for their turn; while so many do, further ones wait in DDS.
const WAITING: usize = 256;

/// Answers requests with `handler`, one after the other, until `stop`. A handler that panics costs its own answer
/// only. Requests are taken in while a handler works, however long that takes: DDS keeps a few only.
pub(crate) async fn answer_all<S, H, F>(server: Server<S>, mut handler: H, stop: Stop)
where
    S: Service,
    H: FnMut(S::Request) -> F + Send + 'static,
    F: Future<Output = S::Response> + Send + 'static,
{
    let server = Arc::new(server);
    let (line, mut waiting) = channel(WAITING);
    tokio::spawn(take_in(Arc::clone(&server), line, stop.clone()));
    while let Some(Some((call, request))) = stop.or(waiting.recv()).await {
        let mut work = tokio::spawn(handler(request));
        match stop.or(&mut work).await {
            Some(Ok(response)) => server.answer(&call, &response).await,
            Some(Err(error)) => tracing::error!("{}: no answer: {error}", server.name()),
            None => return work.abort(),
        }
    }
}

async fn take_in<S: Service>(server: Arc<Server<S>>, line: Sender<(Call, S::Request)>, stop: Stop) {
    while let Some(request) = stop.or(server.receive()).await {
        // Fails only when the node stops.
        if stop.or(line.send(request)).await.is_none_or(|sent| sent.is_err()) {
            return;
        }
    }
}
