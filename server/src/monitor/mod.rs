//! The port for operators: metrics at `/metrics`, and for probes `/livez`, whether the process makes progress, and `/readyz`, whether it
//! should get calls. It has no secrets and changes nothing, and is served apart from calls, from before the server is ready until its
//! end.

mod page;
mod process;
mod vitals;

use std::{convert::Infallible, sync::Arc, time::Duration};

use bytes::Bytes;
use http::{Method, Request, Response, StatusCode, header};
use http_body_util::Full;
use hyper::{body::Incoming, server::conn::http1, service::service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::sync::Semaphore;

pub(crate) use self::vitals::{Phase, Vitals, set_health};
use crate::{limits::Places, listen::Listener, metrics::CONTENT_TYPE, services::Handler};

/// Largest number of connections; others wait.
const MAX_CONNECTIONS: usize = 16;

/// Longest time of a connection, which has one request.
const MAX_TIME: Duration = Duration::from_secs(10);

/// Pause after an accept failed.
const PAUSE: Duration = Duration::from_millis(500);

/// Answers operators and probes.
#[derive(Debug)]
pub(crate) struct Monitor {
    handler: Handler,
    uploads: Places,
    vitals: Arc<Vitals>,
}

impl Monitor {
    pub(crate) fn new(handler: Handler, uploads: Places, vitals: Arc<Vitals>) -> Arc<Self> {
        process::started();
        Arc::new(Self {
            handler,
            uploads,
            vitals,
        })
    }

    /// Serves until it is dropped.
    pub(crate) async fn serve(self: Arc<Self>, listener: Listener) {
        let places = Arc::new(Semaphore::new(MAX_CONNECTIONS));
        // The semaphore is never closed.
        while let Ok(place) = Arc::clone(&places).acquire_owned().await {
            let Ok((stream, _)) = listener.accept().await else {
                tokio::time::sleep(PAUSE).await;
                continue;
            };
            let monitor = Arc::clone(&self);
            tokio::spawn(async move {
                let answer = service_fn(|request: Request<Incoming>| {
                    let answer = monitor.answer(request.method(), request.uri().path());
                    std::future::ready(Ok::<_, Infallible>(answer))
                });
                let connection = http1::Builder::new()
                    .timer(TokioTimer::new())
                    .keep_alive(false)
                    .serve_connection(TokioIo::new(stream), answer);
                // An error concerns only this connection.
                let _ = tokio::time::timeout(MAX_TIME, connection).await;
                drop(place);
            });
        }
    }

    fn answer(&self, method: &Method, path: &str) -> Response<Full<Bytes>> {
        const PLAIN: &str = "text/plain; charset=utf-8";
        let probe = |state: Result<String, String>| match state {
            Ok(text) => (StatusCode::OK, PLAIN, text + "\n"),
            Err(text) => (StatusCode::SERVICE_UNAVAILABLE, PLAIN, text + "\n"),
        };
        let (status, content_type, text) = match path {
            _ if method != Method::GET && method != Method::HEAD => (
                StatusCode::METHOD_NOT_ALLOWED,
                PLAIN,
                "only GET and HEAD\n".to_owned(),
            ),
            "/metrics" => (StatusCode::OK, CONTENT_TYPE, self.page()),
            "/livez" => probe(self.vitals.alive()),
            "/readyz" => probe(self.vitals.ready()),
            _ => (
                StatusCode::NOT_FOUND,
                PLAIN,
                "there are /metrics, /livez and /readyz\n".to_owned(),
            ),
        };
        let mut answer = Response::new(Full::from(text));
        *answer.status_mut() = status;
        let content_type = http::HeaderValue::from_static(content_type);
        answer.headers_mut().insert(header::CONTENT_TYPE, content_type);
        answer
    }
}
