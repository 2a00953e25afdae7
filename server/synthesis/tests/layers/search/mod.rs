//! Whole searches: the race, how it stops, look-ups of known grips, and the key frames of what is found.

mod barriers;
mod both_hands;
mod choice;
mod current;
mod few_fingers;
mod holdouts;
mod key_frames;
mod limits;
mod race;
mod stopping;
mod verdicts;
