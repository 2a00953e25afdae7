//! The Connect protocol, beside gRPC and gRPC-Web: unary calls as plain JSON or protobuf by POST, for engines and tools without a
//! gRPC library, and streams in envelopes.
//!
//! Two layers around the services, so that no handler knows of it. [`Connect`], the outer one, converts the headers of a request to
//! gRPC's and the frames and status of an answer to Connect's. [`Transcoder`], inside the layer of calls, converts the messages to
//! gRPC's frames and JSON to protobuf, and back. So calls, deadlines, uploads and arriving bytes are counted and bounded as they
//! come in, and answers are packed as they go out.

mod answers;
mod errors;
mod messages;
mod requests;

use http::{Request, Response, Version};
use tonic::body::Body;

pub(crate) use self::messages::Transcoder;
#[cfg(fuzzing)]
pub(crate) use self::messages::{BYTES_OF_VALUE, protobuf};
use self::{answers::answered, requests::call};
use crate::middleware::{Answer, Middleware};

/// How the messages of a call are written and framed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Format {
    /// JSON instead of protobuf.
    json: bool,
    /// In envelopes, as streams are, instead of one bare message.
    enveloped: bool,
}

impl Format {
    /// The format of a content type without parameters.
    pub(crate) fn of(media_type: &str) -> Option<Self> {
        let known = Self::all()
            .into_iter()
            .find(|format| format.content_type() == media_type);
        known.filter(|_| !media_type.is_empty())
    }

    fn all() -> [Self; 4] {
        [(true, false), (false, false), (true, true), (false, true)]
            .map(|(json, enveloped)| Self { json, enveloped })
    }

    /// Its content type.
    pub(crate) fn content_type(self) -> &'static str {
        match (self.enveloped, self.json) {
            (false, true) => "application/json",
            (false, false) => "application/proto",
            (true, true) => "application/connect+json",
            (true, false) => "application/connect+proto",
        }
    }
}

/// The outer layer; see the module documentation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Connect;

impl<B> Middleware<B> for Connect {
    fn handle<E, F>(&self, request: Request<B>, next: impl FnOnce(Request<B>) -> F) -> Answer<E>
    where
        E: Send + 'static,
        F: Future<Output = Result<Response<Body>, E>> + Send + 'static,
    {
        let (mut head, body) = request.into_parts();
        let Some(format) = requests::format(&head.headers) else {
            return Box::pin(next(Request::from_parts(head, body)));
        };
        match call(&mut head, format) {
            Ok(call) => {
                // The layers inside know gRPC only over HTTP/2.
                head.version = Version::HTTP_2;
                head.extensions.insert(call);
                let answer = next(Request::from_parts(head, body));
                Box::pin(async move { Ok(answered(answer.await?, format).await) })
            }
            Err(refusal) => {
                tracing::debug!(path = head.uri.path(), status = %refusal.status(), "refused a request");
                Box::pin(std::future::ready(Ok(*refusal)))
            }
        }
    }
}
