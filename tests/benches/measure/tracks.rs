//! Tracks of moving givers: how soon frames are answered, what opening one costs, and how many a server holds.

pub(crate) mod crowd;
pub(crate) mod latency;
mod play;

/// Frames per second of a headset.
const RATE: f64 = 90.0;
