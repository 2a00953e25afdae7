//! Accepts connections, bounds their number and closes them.

mod accept;
mod connection;

pub(crate) use accept::{AcceptLimits, accept};
pub(crate) use connection::Connection;
