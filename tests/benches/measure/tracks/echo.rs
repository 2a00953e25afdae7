//! A service that sends bytes back on a stream: the cost of gRPC itself for frames and answers of given sizes.

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
    server::{self, NamedService, StreamingService},
    transport::{Endpoint, Server, server::TcpIncoming},
};
use tonic_prost::ProstCodec;

/// Its only method.
const METHOD: &str = "/grasp.bench.Echo/Stream";

/// Leading bytes of a message that hold the length of its answer, little-endian.
const LENGTH_BYTES: usize = size_of::<u32>();

/// Answers every message with as many zeros as its leading bytes say.
#[derive(Clone, Copy, Debug)]
struct Echo;

impl NamedService for Echo {
    const NAME: &'static str = "grasp.bench.Echo";
}

impl StreamingService<Vec<u8>> for Echo {
    type Response = Vec<u8>;
    type ResponseStream = Pin<Box<dyn Stream<Item = Result<Vec<u8>, Status>> + Send>>;
    type Future = std::future::Ready<Result<Response<Self::ResponseStream>, Status>>;

    fn call(&mut self, request: Request<Streaming<Vec<u8>>>) -> Self::Future {
        let answers = request.into_inner().map(|message| {
            let message = message?;
            let length = message.first_chunk::<LENGTH_BYTES>().copied().unwrap_or_default();
            Ok(vec![0; u32::from_le_bytes(length) as usize])
        });
        std::future::ready(Ok(Response::new(Box::pin(answers))))
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
            Ok(grpc.streaming(echo, request).await)
        })
    }
}

/// An open stream to an echo server of its own, which stops when this is dropped.
pub(crate) struct EchoStream {
    messages: mpsc::Sender<Vec<u8>>,
    answers: Streaming<Vec<u8>>,
    _stop: DropGuard,
}

impl EchoStream {
    /// Starts a server on a free port, and opens a stream.
    pub(crate) async fn open() -> Self {
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
        let channel = endpoint
            .tcp_nodelay(true)
            .connect()
            .await
            .expect("the server accepts connections");
        let mut client = client::Grpc::new(channel);
        client.ready().await.expect("the connection is open");
        let (messages, sent) = mpsc::channel(4);
        let path = http::uri::PathAndQuery::from_static(METHOD);
        let codec = ProstCodec::<Vec<u8>, Vec<u8>>::default();
        let answers = client
            .streaming(Request::new(ReceiverStream::new(sent)), path, codec)
            .await;
        Self {
            messages,
            answers: answers.expect("the echo server answers").into_inner(),
            _stop: stop.drop_guard(),
        }
    }

    /// Sends a message of `sent` bytes and waits for its answer of `received` bytes.
    pub(crate) async fn echo(&mut self, sent: usize, received: usize) {
        let length = u32::try_from(received).expect("an answer is no longer than 4 GB");
        let mut bytes = vec![0; sent.max(LENGTH_BYTES)];
        bytes[..LENGTH_BYTES].copy_from_slice(&length.to_le_bytes());
        self.messages.send(bytes).await.expect("the stream is open");
        let answer = self.answers.message().await.expect("the stream is open");
        assert_eq!(answer.expect("the stream goes on").len(), received);
    }
}
