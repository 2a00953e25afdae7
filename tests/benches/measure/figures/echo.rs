//! A service that sends bytes back: the cost of gRPC itself for messages of given sizes.

use std::{
    convert::Infallible,
    task::{Context, Poll},
    time::{Duration, Instant},
};

use tokio::net::TcpListener;
use tokio_util::sync::{CancellationToken, DropGuard};
use tonic::{
    Request, Response, Status,
    body::Body,
    client,
    codegen::{BoxFuture, Service, StdError, http},
    server::{self, NamedService, UnaryService},
    transport::{Channel, Endpoint, Server, server::TcpIncoming},
};
use tonic_prost::ProstCodec;

/// Its only method.
const METHOD: &str = "/grasp.bench.Echo/Echo";

/// Leading bytes of a request that hold the length of the answer, little-endian.
const LENGTH_BYTES: usize = size_of::<u32>();

/// Answers every request with as many zeros as its leading bytes say.
#[derive(Clone, Copy, Debug)]
struct Echo;

impl NamedService for Echo {
    const NAME: &'static str = "grasp.bench.Echo";
}

impl UnaryService<Vec<u8>> for Echo {
    type Response = Vec<u8>;
    type Future = std::future::Ready<Result<Response<Vec<u8>>, Status>>;

    fn call(&mut self, request: Request<Vec<u8>>) -> Self::Future {
        let length = request
            .get_ref()
            .first_chunk::<LENGTH_BYTES>()
            .map(|bytes| u32::from_le_bytes(*bytes));
        std::future::ready(match length {
            Some(length) => Ok(Response::new(vec![0; length as usize])),
            None => Err(Status::invalid_argument(
                "the request does not start with a length",
            )),
        })
    }
}

impl Service<http::Request<Body>> for Echo {
    type Response = http::Response<Body>;
    type Error = Infallible;
    type Future = BoxFuture<Self::Response, Self::Error>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, request: http::Request<Body>) -> Self::Future {
        let echo = *self;
        Box::pin(async move {
            let mut grpc = server::Grpc::new(ProstCodec::<Vec<u8>, Vec<u8>>::default());
            Ok(grpc.unary(echo, request).await)
        })
    }
}

/// A running echo server; stops when dropped.
pub(crate) struct EchoServer {
    endpoint: String,
    _stop: DropGuard,
}

impl EchoServer {
    /// Starts a server on a free port, on the calling runtime.
    pub(crate) async fn start() -> Self {
        let listener = TcpListener::bind((std::net::Ipv6Addr::LOCALHOST, 0))
            .await
            .expect("the loopback interface has a free port");
        let address = listener.local_addr().expect("a bound socket has an address");
        let stop = CancellationToken::new();
        let serving = Server::builder().add_service(Echo).serve_with_incoming_shutdown(
            TcpIncoming::from(listener).with_nodelay(Some(true)),
            stop.clone().cancelled_owned(),
        );
        tokio::spawn(serving);
        Self {
            endpoint: format!("http://{address}"),
            _stop: stop.drop_guard(),
        }
    }

    /// A client with its own connection.
    pub(crate) async fn client(&self) -> EchoClient {
        let endpoint = Endpoint::from_shared(self.endpoint.clone()).expect("an address makes an endpoint");
        let channel = endpoint
            .connect()
            .await
            .expect("the echo server accepts connections");
        EchoClient(client::Grpc::new(channel))
    }
}

/// A client of an echo server.
pub(crate) struct EchoClient(client::Grpc<Channel>);

impl EchoClient {
    /// Duration of a call whose request has `request` bytes and whose answer has `answer` bytes; the wire format adds
    /// three to each.
    pub(crate) async fn time(&mut self, request: usize, answer: usize) -> Duration {
        let length = u32::try_from(answer).expect("an answer is no longer than 4 GB");
        let mut bytes = vec![0; request.max(LENGTH_BYTES)];
        bytes[..LENGTH_BYTES].copy_from_slice(&length.to_le_bytes());
        let start = Instant::now();
        let echoed = self.call(bytes).await.expect("the echo server answers");
        let time = start.elapsed();
        assert_eq!(echoed.len(), answer, "the echo has the requested length");
        time
    }

    async fn call(&mut self, bytes: Vec<u8>) -> Result<Vec<u8>, Status> {
        self.0
            .ready()
            .await
            .map_err(|error| Status::unavailable(StdError::from(error).to_string()))?;
        let codec = ProstCodec::<Vec<u8>, Vec<u8>>::default();
        let path = http::uri::PathAndQuery::from_static(METHOD);
        let answer = self.0.unary(Request::new(bytes), path, codec).await?;
        Ok(answer.into_inner())
    }
}
