//! A giver who moves: frames come, the latest is answered, and the grasp of the answer before is kept as long as it is valid.
//!
//! Nothing queues here. Frames go to an [`Inbox`], where a later one takes the place of one that nobody has taken yet. On a stream, an
//! answer is computed when the transport asks for it and, if the frames say how many answers were read, when few are unread: the
//! transport holds many more. A created track, one of [`OpenTracks`], has a task that answers the calls which push its frames. Each frame
//! is a request to find a grasp with a current one; [`HeldGrasp`] knows which, and [`RecentHands`] where the hands were that it should keep
//! clear of.

mod held_grasp;
mod inbox;
mod motion;
mod open_tracks;
mod recent_hands;

pub(crate) use held_grasp::HeldGrasp;
pub(crate) use inbox::{Inbox, PendingFrame, Reply};
pub(crate) use motion::{Motion, PredictionError};
pub(crate) use open_tracks::{OpenTracks, Task, not_found};
pub(crate) use recent_hands::RecentHands;
