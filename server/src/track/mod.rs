//! A giver who moves: frames come, the latest is answered, and the grasp of the answer before stands as long as it is valid.
//!
//! Nothing queues here. Frames go to an [`Inbox`], where a later one takes the place of one that nobody has taken yet, and an answer is
//! computed when the transport asks for it and, if the frames say how many answers were read, when few are unread: the transport holds
//! many more. Each frame is a request to find a grasp with a standing one; [`Holding`] knows which, and [`Lately`] where the hands were
//! that it should keep clear of.

mod holding;
mod inbox;
mod lately;
mod motion;
mod open_tracks;

pub(crate) use holding::Holding;
pub(crate) use inbox::{Inbox, Latest, Put};
pub(crate) use lately::Lately;
pub(crate) use motion::{Motion, PredictionError};
pub(crate) use open_tracks::{OpenTrack, OpenTracks};
