//! Uploads: their places, and how slowly they may arrive.
//!
//! A place covers memory and processor time: of a message of which more than a little has arrived, and of building an object. A
//! slow trickle takes no place, and ends after a while.

use std::{
    pin::Pin,
    sync::{Arc, OnceLock},
    task::{Context, Poll},
    time::{Duration, Instant},
};

use bytes::Bytes;
use tokio::{sync::OwnedSemaphorePermit, time::Sleep};
use tonic::body::Body;

use crate::{
    client::Client,
    error::ServiceError,
    limits::{ClientPermits, Place, Places},
    middleware::{FrameFilter, PolledFrame, filtered, next_frame},
    sync::{Mutex, locked},
};

/// Bytes of an upload that arrive without a place: the whole of most objects of a few hundred triangles.
pub(super) const BYTES_WITHOUT_PLACE: usize = 64 << 10;

/// Least rate of an upload after its first seconds, in bytes per second on average: a fortieth of a slow home's uplink.
const MIN_RATE: usize = 16 << 10;

/// The right to receive and build an object, once it has a place. The handler takes it from the request and holds it while it works.
#[derive(Clone, Debug)]
pub(crate) struct UploadPermit {
    places: Places,
    client: Client,
    taken: Arc<Mutex<Option<Place>>>,
    /// Each client's permits for heavy work.
    heavy: Arc<ClientPermits>,
    turn: Arc<Mutex<Option<OwnedSemaphorePermit>>>,
    /// Why the request cannot be received to its end.
    failure: Arc<OnceLock<ServiceError>>,
}

impl UploadPermit {
    pub(super) fn new(places: &Places, heavy: &Arc<ClientPermits>, client: Client) -> Self {
        Self {
            places: places.clone(),
            client,
            taken: Arc::default(),
            heavy: Arc::clone(heavy),
            turn: Arc::default(),
            failure: Arc::default(),
        }
    }

    /// Takes the permit out of a request. [`super::Calls`] puts one into each upload.
    pub(crate) fn of<T>(request: &mut tonic::Request<T>) -> Self {
        let permit = request.extensions_mut().remove();
        permit.expect("every upload comes with a permit")
    }

    /// Takes a place, unless it has one.
    pub(crate) fn take_place(&self) -> Result<(), ServiceError> {
        let mut taken = locked(&self.taken);
        if taken.is_none() {
            *taken = Some(self.places.take(&self.client)?);
        }
        Ok(())
    }

    /// Takes a place, and waits until the client builds nothing else.
    pub(crate) async fn take_turn(&self) -> Result<(), ServiceError> {
        self.take_place()?;
        let turn = self.heavy.acquire(&self.client).await;
        *locked(&self.turn) = turn;
        Ok(())
    }

    /// Why the request was cut off, if by these bounds.
    pub(crate) fn failure(&self) -> Option<ServiceError> {
        self.failure.get().cloned()
    }
}

/// Ends the body of an upload with an error if it needs a place and there is none, or if it arrives too slowly.
struct UploadBounds {
    permit: UploadPermit,
    start: Instant,
    /// Longest pause.
    grace: Duration,
    received: usize,
    end: Pin<Box<Sleep>>,
}

/// The body of an upload that starts now and may be slow for `grace`.
pub(super) fn bounded_upload(inner: Body, permit: UploadPermit, grace: Duration) -> Body {
    let start = Instant::now();
    let bounds = UploadBounds {
        permit,
        start,
        grace,
        received: 0,
        end: Box::pin(tokio::time::sleep_until((start + grace).into())),
    };
    filtered(inner, bounds)
}

impl UploadBounds {
    fn fail(&self, error: ServiceError) -> PolledFrame {
        let _ = self.permit.failure.set(error.clone());
        Poll::Ready(Some(Err(error.into())))
    }
}

impl FrameFilter for UploadBounds {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        let polled = next_frame(inner, cx);
        if let Poll::Ready(Some(Ok(frame))) = &polled {
            self.received += frame.data_ref().map_or(0, Bytes::len);
            if self.received > BYTES_WITHOUT_PLACE
                && let Err(error) = self.permit.take_place()
            {
                return self.fail(error);
            }
        }
        if matches!(polled, Poll::Ready(None)) {
            return polled;
        }
        // When it is too slow unless more arrives.
        let of_received = Duration::from_secs_f64(self.received as f64 / MIN_RATE as f64);
        let end = (self.start + self.grace + of_received).into();
        if self.end.deadline() != end {
            self.end.as_mut().reset(end);
        }
        if self.end.as_mut().poll(cx).is_ready() {
            return self.fail(ServiceError::UploadTooSlow { least: MIN_RATE });
        }
        polled
    }
}

#[cfg(test)]
mod tests {
    use http_body::Frame;
    use http_body_util::{BodyExt as _, StreamBody};
    use tokio::sync::mpsc;
    use tokio_stream::wrappers::ReceiverStream;
    use tonic::Status;

    use super::*;
    use crate::error::Limit;

    #[tokio::test]
    async fn an_upload_that_drips_ends_and_a_quick_one_goes_on() {
        let places = Places::new(Limit::Uploads, 1, Duration::ZERO);
        let [(quickly, mut quick, _), (dripping, mut slow, permit)] = [(); 2].map(|()| {
            let (sender, receiver) = mpsc::channel(1000);
            let permit = UploadPermit::new(&places, &Arc::new(ClientPermits::new(1)), Client::Local);
            let inner = Body::new(StreamBody::new(ReceiverStream::new(receiver)));
            let body = bounded_upload(inner, permit.clone(), Duration::from_millis(100));
            (sender, body, permit)
        });
        tokio::spawn(async move {
            loop {
                for (sender, bytes) in [(&quickly, MIN_RATE / 10), (&dripping, 1)] {
                    let frame = Frame::data(Bytes::from(vec![0; bytes]));
                    let _ = sender.send(Ok::<_, Status>(frame)).await;
                }
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        });
        let start = Instant::now();
        while slow.frame().await.unwrap().is_ok() {}
        assert!(start.elapsed() < Duration::from_secs(2));
        let failure = permit.failure();
        assert!(
            matches!(failure, Some(ServiceError::UploadTooSlow { .. })),
            "{failure:?}"
        );
        while start.elapsed() < Duration::from_millis(400) {
            quick.frame().await.unwrap().unwrap();
        }
    }
}
