//! Accepts connections, bounds their number, calls, frames, unread answers and arriving bytes, and serves and closes them.
//!
//! The accept loop and the serving of connections replace the transport's, which retries immediately when an accept fails (with all
//! files in use, that costs most of a core), lets one client take every place, and waits for idle connections at the end.

mod accept;
mod answers;
mod connections;
mod frames;
mod reader;
mod serving;
mod stream;

pub(crate) use accept::accept;
pub(crate) use answers::{UnreadCount, arriving};
pub(crate) use connections::Connections;
pub(crate) use reader::Reader;
pub(crate) use serving::{ConnectionServer, Lifetime};
