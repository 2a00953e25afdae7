//! Small runs: complete, interrupted, extended and rejected.

mod beyond_ladder;
mod records;
mod reports;
mod run_folder;
