//! The experiment: its charts as a reader sees them, and small runs as a whole.

mod fixtures;
mod plots;
mod runs;
