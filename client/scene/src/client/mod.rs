//! What clients send and receive, as scenes (feature `client`).
//!
//! Hands are posed by the joints sent over the wire, with the skins of the built-in rigs.

mod hands;
mod object_look;
mod receiver;
mod track;

use std::fmt;

pub use hands::{Giver, SceneHand, giver, receiver, synthesis_pose};
pub use object_look::ObjectLook;
pub use track::TrackRecording;

/// Why something cannot be drawn, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CannotDraw(pub String);

impl fmt::Display for CannotDraw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for CannotDraw {}
