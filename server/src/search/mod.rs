//! Runs grasp searches on the threads of the executor.

mod either_hand;
mod evaluate;
mod find;
mod holdout;
mod job;
mod judge;
mod progress;
mod slices;
mod stream;
#[cfg(test)]
mod verdict_tests;

pub(crate) use evaluate::{EvaluateJob, evaluate};
pub(crate) use find::find;
pub(crate) use job::{Answered, FindJob};
pub(crate) use judge::{JudgeJob, judge};
pub(crate) use stream::{Found, Stream, Wanted};
