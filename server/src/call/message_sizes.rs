//! A service whose methods take messages of different sizes.

use std::task::{Context, Poll};

use http::Request;
use tonic::server::NamedService;
use tower::Service;

use super::layer::is_upload;

/// The same service twice: with the bound on messages that methods for uploads have, and with that of all others. The bounds
/// hold for unpacked messages, too.
#[derive(Clone, Debug)]
pub(crate) struct BySize<S> {
    /// For uploads.
    pub large: S,
    /// For all other methods.
    pub small: S,
}

impl<S: NamedService> NamedService for BySize<S> {
    const NAME: &'static str = S::NAME;
}

impl<S: Service<Request<B>>, B> Service<Request<B>> for BySize<S> {
    type Response = S::Response;
    type Error = S::Error;
    type Future = S::Future;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        match (self.large.poll_ready(cx), self.small.poll_ready(cx)) {
            (Poll::Ready(large), Poll::Ready(small)) => Poll::Ready(large.and(small)),
            _ => Poll::Pending,
        }
    }

    fn call(&mut self, request: Request<B>) -> S::Future {
        if is_upload(request.uri().path()) {
            self.large.call(request)
        } else {
            self.small.call(request)
        }
    }
}
