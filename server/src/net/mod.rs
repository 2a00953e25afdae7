//! Accepts connections, bounds their number, their calls and what waits on them unread, and closes them.

mod accept;
mod answers;
mod calls;
mod connection;
mod unread;

pub(crate) use accept::{AcceptLimits, accept};
pub(crate) use answers::{AdmitLayer, UnreadLayer};
pub(crate) use connection::{Connection, ConnectionInfo};
pub(crate) use unread::UnreadAnswers;
