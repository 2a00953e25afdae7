//! Grasp searches: what a request asks for and what is known, run on the threads of the executor.

mod job;
mod slices;

pub(crate) use job::{FindJob, find};
