//! Runs grasp searches on the threads of the executor.

mod job;
mod slices;

pub(crate) use job::{FindJob, find};
