//! Accepts connections, bounds their number, their calls, what waits on them unread and what arrives on them, and closes them.

mod accept;
mod answers;
mod connection;
mod unread;

pub(crate) use accept::{AcceptLimits, accept};
pub(crate) use answers::{Admission, UnreadCount, arriving};
pub(crate) use connection::{Connection, ConnectionInfo};
pub(crate) use unread::UnreadAnswers;
