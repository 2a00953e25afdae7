//! A client of HTTP/2 that does what well-behaved ones do not: stops reading, trickles a request, or ends a call or a connection at any
//! moment. Unlike tonic's, it also waits beyond a call's deadline.

use std::io;

use bytes::Bytes;
use h2::{
    SendStream,
    client::{ResponseFuture, SendRequest},
};
use http::Request;
use prost::Message;
use tokio::{net::TcpStream, task::JoinHandle};

use crate::TestServer;

/// A connection.
#[derive(Debug)]
pub struct Connection {
    sender: SendRequest<Bytes>,
    /// Ends with the connection. Aborting it closes the connection without a word.
    pub task: JoinHandle<Result<(), h2::Error>>,
}

/// A call whose request goes on.
pub type OpenCall = (ResponseFuture, SendStream<Bytes>);

impl Connection {
    /// Connects; each call's answer may have `window` bytes before some are read.
    pub async fn open(server: &TestServer, window: u32) -> Self {
        let stream = TcpStream::connect(server.address())
            .await
            .expect("the server accepts connections");
        Self::over(stream, window)
            .await
            .expect("the server speaks HTTP/2")
    }

    /// The same over a stream.
    ///
    /// # Errors
    /// The stream is closed.
    pub async fn over(stream: TcpStream, window: u32) -> io::Result<Self> {
        let handshake = h2::client::Builder::new()
            .initial_window_size(window)
            .handshake(stream);
        let (sender, connection) = handshake.await.map_err(io::Error::other)?;
        let task = tokio::spawn(connection);
        Ok(Self { sender, task })
    }

    /// Begins a call of a method, such as "grasp.v1.ObjectService/GetObject"; `None` if the connection is closed. `headers` replace
    /// the usual content type if they have one.
    pub async fn call(&mut self, method: &str, headers: &[(&str, &str)]) -> Option<OpenCall> {
        let mut request = Request::post(format!("http://localhost/{method}")).header("te", "trailers");
        if headers.iter().all(|(name, _)| *name != "content-type") {
            request = request.header("content-type", "application/grpc");
        }
        for &(name, value) in headers {
            request = request.header(name, value);
        }
        let request = request.body(()).expect("method and headers are valid");
        self.sender = self.sender.clone().ready().await.ok()?;
        self.sender.send_request(request, false).ok()
    }
}

/// A message as gRPC frames it.
pub fn framed(message: &impl Message) -> Vec<u8> {
    framed_bytes(&message.encode_to_vec())
}

/// Bytes as gRPC frames a message.
pub fn framed_bytes(message: &[u8]) -> Vec<u8> {
    let length = u32::try_from(message.len()).expect("messages have less than 4 GiB");
    [&[0], &length.to_be_bytes()[..], message].concat()
}
