//! Connections: accepting them, bounding their number, ending them.

mod accept;
mod connection;

pub(crate) use accept::{AcceptLimits, accept};
pub(crate) use connection::Connection;
