//! A giver who moves: frames come, the latest is answered, and the grasp of the answer before stands as long as it is valid.
//!
//! Nothing queues. Frames go to an [`Inbox`], where a later one takes the place of one that nobody has taken yet, and an answer is
//! computed when the transport asks for it: a client that reads slowly gets the answer to its latest frame, and one that does
//! not read costs no work. Each frame is a request to find a grasp with a standing one; [`Holding`] knows which.

mod holding;
mod inbox;
mod motion;
mod open_tracks;

pub(crate) use holding::Holding;
pub(crate) use inbox::{Inbox, Put};
pub(crate) use motion::{Motion, PredictionError};
pub(crate) use open_tracks::{OpenTrack, OpenTracks};
