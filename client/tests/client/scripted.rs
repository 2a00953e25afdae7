//! A tiny server that follows a script, whichever method is called.

use std::{
    collections::VecDeque,
    convert::Infallible,
    sync::{Arc, Mutex},
};

use http::{HeaderMap, HeaderValue, Request, Response};
use http_body_util::{BodyExt as _, Full};
use prost::Message;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::{Status, body::Body, codegen::Bytes, service::Routes, transport::Server};

#[derive(Clone)]
pub(crate) enum Act {
    Fail(Status),
    /// With messages, each after its length as gRPC frames them.
    Answer(Vec<u8>),
    Hang,
}

impl Act {
    pub(crate) fn unavailable() -> Self {
        Self::Fail(Status::unavailable("draining"))
    }

    pub(crate) fn answer<M: Message>(messages: &[M]) -> Self {
        let mut body = Vec::new();
        for message in messages {
            body.push(0);
            body.extend((message.encoded_len() as u32).to_be_bytes());
            body.extend(message.encode_to_vec());
        }
        Self::Answer(body)
    }
}

#[derive(Clone)]
pub(crate) struct Call {
    /// The header `grpc-timeout`.
    pub(crate) timeout: String,
    body: Bytes,
}

impl Call {
    /// The messages of the request.
    pub(crate) fn messages<M: Message + Default>(&self) -> Vec<M> {
        let (mut rest, mut messages) = (&self.body[..], Vec::new());
        while let Some((header, after)) = rest.split_first_chunk::<5>() {
            let length = u32::from_be_bytes([header[1], header[2], header[3], header[4]]);
            let (message, after) = after.split_at(length as usize);
            messages.push(M::decode(message).unwrap());
            rest = after;
        }
        messages
    }
}

#[derive(Clone)]
pub(crate) struct Scripted {
    script: Arc<Mutex<VecDeque<Act>>>,
    calls: Arc<Mutex<Vec<Call>>>,
}

impl Scripted {
    pub(crate) fn new(script: impl IntoIterator<Item = Act>) -> Self {
        Self {
            script: Arc::new(Mutex::new(script.into_iter().collect())),
            calls: Arc::default(),
        }
    }

    pub(crate) fn calls(&self) -> Vec<Call> {
        self.calls.lock().unwrap().clone()
    }

    /// Serves on a free port until the test's runtime ends; returns the URL.
    pub(crate) async fn serve(&self) -> String {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let service = self.clone();
        let layer = tower::layer::layer_fn(move |_: Routes| {
            let service = service.clone();
            tower::service_fn(move |request| service.clone().follow(request))
        });
        let router = Server::builder().layer(layer).add_routes(Routes::default());
        tokio::spawn(router.serve_with_incoming(TcpListenerStream::new(listener)));
        url
    }

    async fn follow(self, request: Request<Body>) -> Result<Response<Body>, Infallible> {
        let timeout = request.headers().get("grpc-timeout");
        let timeout = timeout.map_or("", |timeout| timeout.to_str().unwrap()).to_owned();
        let body = request.into_body().collect().await.unwrap().to_bytes();
        self.calls.lock().unwrap().push(Call { timeout, body });
        let act = self.script.lock().unwrap().pop_front();
        Ok(match act.expect("the script covers every call") {
            Act::Fail(status) => status.into_http(),
            Act::Hang => std::future::pending().await,
            Act::Answer(body) => {
                let mut trailers = HeaderMap::new();
                trailers.insert("grpc-status", HeaderValue::from_static("0"));
                let body = Full::new(Bytes::from(body)).with_trailers(async { Some(Ok(trailers)) });
                let mut response = Response::new(Body::new(body));
                let grpc = HeaderValue::from_static("application/grpc");
                response.headers_mut().insert("content-type", grpc);
                response
            }
        })
    }
}
