//! Whole searches: the race, how it stops, look-ups of known grips, and the key frames of what is found.

mod built_in_holdouts;
mod hooks;
mod key_frames;
mod look_up;
mod mechanisms;
mod race;
mod refinement;
mod stopping;
