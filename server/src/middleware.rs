//! Layers of services, each written as a function of a request and of what passes it on.

use std::{
    future::Future,
    pin::Pin,
    task::{Context, Poll},
};

use http::{Request, Response};
use tonic::body::Body;
use tower::{Layer, Service};

/// The answer to a request.
pub(crate) type Answer<E> = Pin<Box<dyn Future<Output = Result<Response<Body>, E>> + Send>>;

/// What is done with the requests of services.
pub(crate) trait Middleware<B>: Clone {
    /// Answers a request; `next` passes it to the services inside.
    fn handle<E, F>(&self, request: Request<B>, next: impl FnOnce(Request<B>) -> F) -> Answer<E>
    where
        E: Send + 'static,
        F: Future<Output = Result<Response<Body>, E>> + Send + 'static;
}

/// The layer of a middleware.
#[derive(Clone, Debug)]
pub(crate) struct Around<M>(pub(crate) M);

impl<M: Clone, S> Layer<S> for Around<M> {
    type Service = AroundService<M, S>;

    fn layer(&self, inner: S) -> Self::Service {
        AroundService {
            middleware: self.0.clone(),
            inner,
        }
    }
}

/// A service in the layer of a middleware.
#[derive(Clone, Debug)]
pub(crate) struct AroundService<M, S> {
    middleware: M,
    inner: S,
}

impl<M, S, B> Service<Request<B>> for AroundService<M, S>
where
    M: Middleware<B>,
    S: Service<Request<B>, Response = Response<Body>>,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = Answer<S::Error>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.inner.poll_ready(cx)
    }

    fn call(&mut self, request: Request<B>) -> Self::Future {
        let Self { middleware, inner } = self;
        middleware.handle(request, |request| inner.call(request))
    }
}
