//! Whole searches: the race, how it stops, look-ups of known grips, and the key frames of what is found.

mod alternatives;
mod barriers;
mod both_hands;
mod built_in_holdouts;
mod current;
mod evaluation;
mod hooks;
mod key_frames;
mod limits;
mod look_up;
mod missing_fingers;
mod preferences;
mod race;
mod refinement;
mod stopping;
mod verdicts;
