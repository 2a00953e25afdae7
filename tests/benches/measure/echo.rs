//! A service that sends bytes back, by calls and on streams: the cost of gRPC itself for messages of given sizes.

use std::{
    convert::Infallible,
    pin::Pin,
    task::{Context, Poll},
};

use tokio::{net::TcpListener, sync::mpsc};
use tokio_stream::{Stream, StreamExt as _, wrappers::ReceiverStream};
use tokio_util::sync::{CancellationToken, DropGuard};
use tonic::{
    Request, Response, Status, Streaming,
    body::Body,
    client,
    codegen::{BoxFuture, Service, http},
    server::{self, NamedService, StreamingService, UnaryService},
    transport::{Channel, Endpoint, Server, server::TcpIncoming},
};
use tonic_prost::ProstCodec;

/// Its methods.
const CALL: &str = "/grasp.bench.Echo/Call";
const STREAM: &str = "/grasp.bench.Echo/Stream";

/// Leading bytes of a message that hold the length of its answer, little-endian.
const LENGTH_BYTES: usize = size_of::<u32>();

/// Answers every message with as many zeros as its leading bytes say.
#[derive(Clone, Copy, Debug)]
struct Echo;

fn answer_to(message: &[u8]) -> Vec<u8> {
    let length = message.first_chunk::<LENGTH_BYTES>().copied().unwrap_or_default();
    vec![0; u32::from_le_bytes(length) as usize]
}

/// A message of a size whose answer has a size; the wire format adds three bytes to each.
fn message(sent: usize, received: usize) -> Vec<u8> {
    let length = u32::try_from(received).expect("an answer is no longer than 4 GB");
    let mut bytes = vec![0; sent.max(LENGTH_BYTES)];
    bytes[..LENGTH_BYTES].copy_from_slice(&length.to_le_bytes());
    bytes
}

fn codec() -> ProstCodec<Vec<u8>, Vec<u8>> {
    ProstCodec::default()
}

impl NamedService for Echo {
    const NAME: &'static str = "grasp.bench.Echo";
}

impl UnaryService<Vec<u8>> for Echo {
    type Response = Vec<u8>;
    type Future = std::future::Ready<Result<Response<Vec<u8>>, Status>>;

    fn call(&mut self, request: Request<Vec<u8>>) -> Self::Future {
        std::future::ready(Ok(Response::new(answer_to(request.get_ref()))))
    }
}

impl StreamingService<Vec<u8>> for Echo {
    type Response = Vec<u8>;
    type ResponseStream = Pin<Box<dyn Stream<Item = Result<Vec<u8>, Status>> + Send>>;
    type Future = std::future::Ready<Result<Response<Self::ResponseStream>, Status>>;

    fn call(&mut self, request: Request<Streaming<Vec<u8>>>) -> Self::Future {
        let messages = request.into_inner();
        let answers: Self::ResponseStream = Box::pin(messages.map(|message| Ok(answer_to(&message?))));
        std::future::ready(Ok(Response::new(answers)))
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
            let mut grpc = server::Grpc::new(codec());
            Ok(if request.uri().path() == STREAM {
                grpc.streaming(echo, request).await
            } else {
                grpc.unary(echo, request).await
            })
        })
    }
}

/// A client of an echo server of its own, which stops when this is dropped.
pub(crate) struct EchoClient {
    grpc: client::Grpc<Channel>,
    _stop: DropGuard,
}

impl EchoClient {
    /// Starts a server on a free port, on the calling runtime, and connects to it.
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
        let endpoint =
            Endpoint::from_shared(format!("http://{address}")).expect("an address makes an endpoint");
        let channel = endpoint.connect().await.expect("the server accepts connections");
        Self {
            grpc: client::Grpc::new(channel),
            _stop: stop.drop_guard(),
        }
    }

    /// A call whose request and answer have these sizes in bytes.
    pub(crate) async fn call(&mut self, sent: usize, received: usize) {
        self.grpc.ready().await.expect("the connection is open");
        let path = http::uri::PathAndQuery::from_static(CALL);
        let request = Request::new(message(sent, received));
        let answer = self.grpc.unary(request, path, codec()).await;
        let answer: Response<Vec<u8>> = answer.expect("the echo server answers");
        assert_eq!(answer.get_ref().len(), received);
    }

    /// Opens a stream.
    pub(crate) async fn open(mut self) -> EchoStream {
        self.grpc.ready().await.expect("the connection is open");
        let (messages, sent) = mpsc::channel(4);
        let path = http::uri::PathAndQuery::from_static(STREAM);
        let request = Request::new(ReceiverStream::new(sent));
        let answers = self.grpc.streaming(request, path, codec()).await;
        EchoStream {
            messages,
            answers: answers.expect("the echo server answers").into_inner(),
            _client: self,
        }
    }
}

/// An open stream to an echo server.
pub(crate) struct EchoStream {
    messages: mpsc::Sender<Vec<u8>>,
    answers: Streaming<Vec<u8>>,
    _client: EchoClient,
}

impl EchoStream {
    /// Sends a message and waits for its answer; their sizes are in bytes.
    pub(crate) async fn echo(&mut self, sent: usize, received: usize) {
        let sending = self.messages.send(message(sent, received));
        sending.await.expect("the stream is open");
        let answer = self.answers.message().await.expect("the stream is open");
        assert_eq!(answer.expect("the stream goes on").len(), received);
    }
}
