//! Traces, as a collector of OpenTelemetry gets them.

use std::{
    convert::Infallible,
    sync::{Arc, Mutex},
    task::{Context, Poll},
    time::Duration,
};

use futures_util::future::BoxFuture;
use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient};
use grasp_server::{Config, Server, config::StorePlace};
use http::{HeaderMap, Request, Response};
use http_body::Frame;
use http_body_util::{BodyExt as _, StreamBody};
use prost::Message;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tonic::{Status, body::Body, server::NamedService, transport};

/// The parts of `ExportTraceServiceRequest` that matter here.
#[derive(Clone, PartialEq, Message)]
struct Export {
    #[prost(message, repeated, tag = "1")]
    resources: Vec<ResourceSpans>,
}

#[derive(Clone, PartialEq, Message)]
struct ResourceSpans {
    #[prost(message, repeated, tag = "2")]
    scopes: Vec<ScopeSpans>,
}

#[derive(Clone, PartialEq, Message)]
struct ScopeSpans {
    #[prost(message, repeated, tag = "2")]
    spans: Vec<Span>,
}

#[derive(Clone, PartialEq, Message)]
struct Span {
    #[prost(bytes = "vec", tag = "1")]
    trace_id: Vec<u8>,
    #[prost(bytes = "vec", tag = "2")]
    span_id: Vec<u8>,
    #[prost(bytes = "vec", tag = "4")]
    parent: Vec<u8>,
    #[prost(string, tag = "5")]
    name: String,
    #[prost(fixed64, tag = "7")]
    start: u64,
    #[prost(fixed64, tag = "8")]
    end: u64,
}

/// Keeps every span.
#[derive(Clone, Default)]
struct Collector(Arc<Mutex<Vec<Span>>>);

impl NamedService for Collector {
    const NAME: &'static str = "opentelemetry.proto.collector.trace.v1.TraceService";
}

impl tower::Service<Request<Body>> for Collector {
    type Response = Response<Body>;
    type Error = Infallible;
    type Future = BoxFuture<'static, Result<Response<Body>, Infallible>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, request: Request<Body>) -> Self::Future {
        let collected = Arc::clone(&self.0);
        Box::pin(async move {
            let frame = request.into_body().collect().await.expect("a message").to_bytes();
            let export = Export::decode(&frame[5..]).expect("it is not packed");
            let scopes = export.resources.into_iter().flat_map(|resource| resource.scopes);
            collected
                .lock()
                .unwrap()
                .extend(scopes.flat_map(|scope| scope.spans));
            let trailers = HeaderMap::from_iter([("grpc-status".parse().unwrap(), "0".parse().unwrap())]);
            // An empty message.
            let frames = [
                Ok::<_, Status>(Frame::data(vec![0; 5].into())),
                Ok(Frame::trailers(trailers)),
            ];
            let body = Body::new(StreamBody::new(futures_util::stream::iter(frames)));
            let answer = Response::builder().header("content-type", "application/grpc");
            Ok(answer.body(body).expect("it is complete"))
        })
    }
}

async fn listen() -> (TcpListener, String) {
    let listener = TcpListener::bind("127.0.0.1:0")
        .await
        .expect("there is a free port");
    let address = format!("http://{}", listener.local_addr().expect("it is bound"));
    (listener, address)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_call_is_a_span_of_its_callers_trace_with_its_parts() {
    let collector = Collector::default();
    let (listener, endpoint) = listen().await;
    let incoming = tokio_stream::wrappers::TcpListenerStream::new(listener);
    tokio::spawn(
        transport::Server::builder()
            .add_service(collector.clone())
            .serve_with_incoming(incoming),
    );
    let config = Config {
        otlp_endpoint: Some(endpoint),
        place: StorePlace::Memory,
        builder_threads: 0,
        ..Config::default()
    };
    let (listener, address) = listen().await;
    let stop = CancellationToken::new();
    let server = Server::new(config).expect("it starts");
    let serving = tokio::spawn(server.serve([listener.into()], stop.clone().cancelled_owned()));
    let mut client = GraspServiceClient::connect(address).await.expect("it accepts");
    let find = v1::FindGraspRequest::new("objects/remote").with_budget(Duration::from_secs(5));
    let mut request = tonic::Request::new(find);
    let trace = "0af7651916cd43dd8448eb211c80319c";
    let parent = format!("00-{trace}-b7ad6b7169203331-01");
    request
        .metadata_mut()
        .insert("traceparent", parent.parse().expect("it is ASCII"));
    client.find_grasp(request).await.expect("there is a grasp");
    drop(client);
    stop.cancel();
    serving.await.expect("it does not panic").expect("it ends well");
    let spans = collector.0.lock().unwrap().clone();
    let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
    let call = spans
        .iter()
        .find(|span| span.name == "grasp.v1.GraspService/FindGrasp")
        .expect("it was sent");
    assert_eq!(
        (hex(&call.trace_id).as_str(), hex(&call.parent).as_str()),
        (trace, "b7ad6b7169203331")
    );
    let mut end = call.start;
    for name in ["queue", "search"] {
        let part = spans
            .iter()
            .find(|span| span.name == name)
            .unwrap_or_else(|| panic!("{name} in {spans:?}"));
        assert_eq!((&part.trace_id, &part.parent), (&call.trace_id, &call.span_id));
        assert!(
            end <= part.start && part.start <= part.end && part.end <= call.end,
            "{spans:?}"
        );
        end = part.end;
    }
}
