//! Answers of many messages: a task sends them into a short queue, from which the transport takes them as fast as the client reads.
//! Messages made from existing data need no queue: each is made when the transport takes it.

use std::{iter, sync::Arc, time::Duration};

use futures_util::stream::{self, BoxStream};
use tokio::sync::mpsc::{self, error::SendTimeoutError};
use tokio_stream::wrappers::ReceiverStream;
use tonic::Status;

use super::Shared;
use crate::{
    error::ServiceError,
    executor::contained,
    faults::FaultPoint,
    sync::{Mutex, locked},
};

/// Messages that wait for the transport. More keep a quick client busier; each takes memory per stream.
const QUEUED: usize = 2;

/// How long a client may take no message: as long as its connection may stall.
const MAX_STALL: Duration = Duration::from_secs(20);

/// The messages of an answer.
pub(crate) type Messages<T> = BoxStream<'static, Result<T, Status>>;

#[derive(Debug)]
pub(crate) struct MessageSender<T>(mpsc::Sender<Result<T, Status>>);

impl<T> MessageSender<T> {
    /// Waits until there is room for a message, and sends it.
    pub(crate) async fn send(&self, message: T) -> Result<(), ServiceError> {
        let sent = self.0.send_timeout(Ok(message), MAX_STALL).await;
        sent.map_err(|error| match error {
            SendTimeoutError::Timeout(_) => ServiceError::ReaderStalled { limit: MAX_STALL },
            SendTimeoutError::Closed(_) => ServiceError::Cancelled,
        })
    }
}

/// Sends the messages of `produce` in a task that ends when the client is gone. An error becomes the status, and so do a panic and the
/// end of the server.
pub(crate) fn messages<T, F>(shared: &Shared, produce: impl FnOnce(MessageSender<T>) -> F) -> Messages<T>
where
    T: Send + 'static,
    F: Future<Output = Result<(), ServiceError>> + Send + 'static,
{
    let (sender, receiver) = mpsc::channel(QUEUED);
    let producing = produce(MessageSender(sender.clone()));
    let (shutdown, faults) = (shared.shutdown.clone(), shared.executor.faults.clone());
    let producing = contained(async move {
        faults.at(FaultPoint::Stream);
        producing.await
    });
    tokio::spawn(async move {
        let produced = tokio::select! {
            () = sender.closed() => return,
            () = shutdown.cancelled_owned() => Err(ServiceError::ShuttingDown),
            produced = producing => produced,
        };
        if let Err(error) = produced {
            // If the client is gone, nobody misses the status.
            let _ = sender.send(Err(error.into())).await;
        }
    });
    Box::pin(ReceiverStream::new(receiver))
}

/// An answer of these messages, each made when the transport takes it. Their source is dropped if the client stalls for too long.
pub(crate) fn lazy_messages<T: 'static>(messages: impl Iterator<Item = T> + Send + 'static) -> Messages<T> {
    lazy_within(MAX_STALL, messages)
}

fn lazy_within<T: 'static>(
    longest_stall: Duration,
    messages: impl Iterator<Item = T> + Send + 'static,
) -> Messages<T> {
    // The remaining messages, `None` once the client has stalled for too long; and the number of those taken.
    let left = Arc::new(Mutex::new((Some(messages), 0_u64)));
    let watched = Arc::downgrade(&left);
    tokio::spawn(async move {
        let mut before = 0;
        loop {
            tokio::time::sleep(longest_stall).await;
            let Some(left) = watched.upgrade() else { return };
            let (messages, taken) = &mut *locked(&left);
            if std::mem::replace(&mut before, *taken) == *taken {
                *messages = None;
                return;
            }
        }
    });
    Box::pin(stream::iter(iter::from_fn(move || {
        let (messages, taken) = &mut *locked(&left);
        *taken += 1;
        match messages {
            Some(messages) => messages.next().map(Ok),
            None => Some(Err(ServiceError::ReaderStalled { limit: MAX_STALL }.into())),
        }
    })))
}

#[cfg(test)]
mod tests {
    use tokio_stream::StreamExt as _;
    use tonic::Code;

    use super::*;

    #[tokio::test]
    async fn lazy_messages_are_dropped_when_nobody_takes_them() {
        let stall = Duration::from_millis(200);
        let kept = Arc::new(());
        let holding = Arc::clone(&kept);
        let messages = (0..100).map(move |number| (number, Arc::clone(&holding)).0);
        let mut sent = lazy_within(stall, messages);
        for number in 0..5 {
            assert_eq!(sent.next().await.unwrap().unwrap(), number);
            tokio::time::sleep(stall / 2).await;
        }
        assert_eq!(Arc::strong_count(&kept), 2);
        tokio::time::sleep(stall * 2).await;
        assert_eq!(Arc::strong_count(&kept), 1);
        let status = sent.next().await.unwrap().unwrap_err();
        assert_eq!(status.code(), Code::DeadlineExceeded);
    }
}
