//! Runs grasp searches on the threads of the executor.

mod holdout;
mod job;
mod slices;

pub(crate) use job::{FindJob, find};
