//! Pages in browsers: who may call, and what browsers need to know to let them; and what is neither gRPC nor gRPC-Web.
//!
//! gRPC-Web itself is a layer of tonic-web. A browser names the page's origin with every call. Pages of other origins than
//! those of the configuration are refused here: cross-origin rules alone would only keep them from reading the answer, and
//! not even that once a name of theirs leads to this server.

mod layer;
mod origins;
mod protocol;

pub(crate) use layer::{cors, refuse_origins};
pub use origins::WebOrigins;
pub(crate) use origins::{NEEDED_ORIGINS, parse_origins};
pub(crate) use protocol::refuse_protocols;
