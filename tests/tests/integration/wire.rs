//! Clients made by hand: of gRPC over HTTP/2, of gRPC-Web over HTTP/1.1 as browsers are, and of Connect over both.

use std::{fmt::Write as _, net::SocketAddr};

use bytes::Bytes;
use grasp_tests::TestServer;
pub(crate) use grasp_tests::raw::{Connection, OpenCall, framed, framed_bytes};
use h2::client::ResponseFuture;
use http::{HeaderMap, HeaderName};
use prost::Message;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
};
use tonic::{Code, Status};

use crate::fixtures::bounded;

/// Bit of a frame's first byte that marks trailers.
const TRAILERS: u8 = 0x80;

/// An answer.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    /// Names in lower case.
    pub(crate) headers: Vec<(String, String)>,
    pub(crate) body: Vec<u8>,
}

impl Answer {
    /// The value of a header.
    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        let header = self.headers.iter().find(|(known, _)| known == name);
        header.map(|(_, value)| value.as_str())
    }

    /// The messages, and the status that follows them.
    pub(crate) fn messages<M: Message + Default>(&self) -> (Vec<M>, Status) {
        let mut messages = Vec::new();
        let mut rest = self.body.as_slice();
        let mut trailers: Vec<(String, String)> = self.headers.clone();
        while let [flags, a, b, c, d, frame @ ..] = rest {
            let (frame, after) = frame.split_at(u32::from_be_bytes([*a, *b, *c, *d]) as usize);
            rest = after;
            if flags & TRAILERS == 0 {
                messages.push(M::decode(frame).expect("it is a message"));
            } else {
                trailers = fields(std::str::from_utf8(frame).expect("trailers are text"));
            }
        }
        assert!(rest.is_empty(), "a frame is cut short: {rest:?}");
        (messages, status_in(&trailers))
    }

    /// The status among the headers.
    pub(crate) fn status_in_headers(&self) -> Status {
        status_in(&self.headers)
    }
}

fn status_in(headers: &[(String, String)]) -> Status {
    let headers = headers.iter().map(|(name, value)| {
        let name = HeaderName::from_bytes(name.as_bytes()).expect("it is a name");
        (name, value.parse().expect("it is a value"))
    });
    let status = Status::from_header_map(&headers.collect::<HeaderMap>());
    status.unwrap_or_else(|| Status::new(Code::Unknown, "no status"))
}

/// Lines of `name: value`.
fn fields(text: &str) -> Vec<(String, String)> {
    let pairs = text.lines().filter_map(|line| line.split_once(':'));
    pairs
        .map(|(name, value)| (name.trim().to_ascii_lowercase(), value.trim().to_owned()))
        .collect()
}

/// The whole answer to a call over HTTP/2; its trailers are among the headers.
pub(crate) async fn answer_to(call: ResponseFuture) -> Answer {
    let (head, mut stream) = bounded("headers", call).await.unwrap().into_parts();
    let mut body = Vec::new();
    while let Some(chunk) = bounded("the body", stream.data()).await {
        let chunk = chunk.unwrap();
        stream.flow_control().release_capacity(chunk.len()).unwrap();
        body.extend(&chunk);
    }
    let trailers = stream.trailers().await.unwrap().unwrap_or_default();
    let headers = head.headers.iter().chain(&trailers).map(|(name, value)| {
        let value = value.to_str().expect("headers are text");
        (name.as_str().to_owned(), value.to_owned())
    });
    Answer {
        status: head.status.as_u16(),
        headers: headers.collect(),
        body,
    }
}

/// The answer to a unary call of a method of this contract with this body and these headers.
pub(crate) async fn answer_over_http_2(
    server: &TestServer,
    method: &str,
    headers: &[(&str, &str)],
    body: Vec<u8>,
) -> Answer {
    let mut connection = Connection::open(server, 1 << 20).await;
    let call = connection.call(&format!("grasp.v1.{method}"), headers).await;
    let (answer, mut stream) = call.expect("the connection is open");
    // The server may answer before it has read all.
    let _ = stream.send_data(Bytes::from(body), true);
    let answer = answer_to(answer).await;
    connection.task.abort();
    answer
}

/// Calls a method from a page of an origin, with further headers.
pub(crate) async fn call(
    address: SocketAddr,
    method: &str,
    headers: &[(&str, &str)],
    body: Vec<u8>,
) -> Answer {
    let (mut stream, start) = request(address, "POST", &format!("/grasp.v1.{method}"), headers, &body).await;
    // The server may answer before it has read all.
    let _ = stream.write_all(&[start.into_bytes(), body].concat()).await;
    answer(&mut stream).await
}

/// Asks whether a page of an origin may call.
pub(crate) async fn preflight(address: SocketAddr, origin: &str) -> Answer {
    let headers = [
        ("origin", origin),
        ("access-control-request-method", "POST"),
        (
            "access-control-request-headers",
            "content-type,x-grpc-web,grpc-timeout",
        ),
        ("access-control-request-private-network", "true"),
    ];
    without_body(address, "OPTIONS", "/grasp.v1.GraspService/FindGrasp", &headers).await
}

/// Requests a page as a browser's address bar does.
pub(crate) async fn get(address: SocketAddr, path: &str) -> Answer {
    without_body(address, "GET", path, &[]).await
}

async fn without_body(address: SocketAddr, verb: &str, path: &str, headers: &[(&str, &str)]) -> Answer {
    let (mut stream, start) = request(address, verb, path, headers, &[]).await;
    stream.write_all(start.as_bytes()).await.expect("it is sent");
    answer(&mut stream).await
}

/// A connection, and the start of a request with a body.
async fn request(
    address: SocketAddr,
    verb: &str,
    path: &str,
    headers: &[(&str, &str)],
    body: &[u8],
) -> (TcpStream, String) {
    let stream = TcpStream::connect(address).await.expect("the server listens");
    let mut start = format!(
        "{verb} {path} HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\ncontent-length: {}\r\n",
        body.len()
    );
    if verb == "POST" && headers.iter().all(|(name, _)| *name != "content-type") {
        start.push_str("content-type: application/grpc-web+proto\r\nx-grpc-web: 1\r\n");
    }
    for (name, value) in headers {
        let _ = write!(start, "{name}: {value}\r\n");
    }
    start.push_str("\r\n");
    (stream, start)
}

/// Reads an answer to the end of the connection.
async fn answer(stream: &mut TcpStream) -> Answer {
    let mut all = Vec::new();
    let ended = stream.read_to_end(&mut all).await;
    let end = all.windows(4).position(|at| at == b"\r\n\r\n");
    let end = end.unwrap_or_else(|| panic!("no headers in {} bytes, which ended with {ended:?}", all.len()));
    let head = std::str::from_utf8(&all[..end]).expect("headers are text");
    let (line, headers) = head.split_once("\r\n").unwrap_or((head, ""));
    let status = line.split(' ').nth(1).and_then(|status| status.parse().ok());
    let headers = fields(headers);
    let is_chunked = headers
        .iter()
        .any(|(name, value)| name == "transfer-encoding" && value == "chunked");
    let body = &all[end + 4..];
    Answer {
        status: status.unwrap_or_else(|| panic!("no status in {line}")),
        headers,
        body: if is_chunked {
            unchunked(body)
        } else {
            body.to_vec()
        },
    }
}

/// The content of chunks (RFC 9112, 7.1).
fn unchunked(mut rest: &[u8]) -> Vec<u8> {
    let mut content = Vec::new();
    while let Some(end) = rest.windows(2).position(|at| at == b"\r\n") {
        let length = std::str::from_utf8(&rest[..end]).expect("lengths are text");
        let length = usize::from_str_radix(length, 16).expect("a length is hexadecimal");
        let chunk = &rest[end + 2..];
        if length == 0 {
            break;
        }
        content.extend(&chunk[..length]);
        rest = &chunk[length + 2..];
    }
    content
}
