//! Whole searches: the race, how it stops, look-ups of known grips, and the key frames of what is found.

mod choice;
mod current;
mod hands;
mod holdouts;
mod key_frames;
mod limits;
mod race;
mod verdicts;
