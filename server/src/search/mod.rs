//! Runs grasp searches on the threads of the executor.

mod either_hand;
mod find;
mod job;
mod prepared;
mod slices;
#[cfg(test)]
mod tests;
mod verdicts;

pub(crate) use find::{Stream, find};
pub(crate) use job::FindJob;
pub(crate) use prepared::Answered;
pub(crate) use verdicts::{judge, rate};
