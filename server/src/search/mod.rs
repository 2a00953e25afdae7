//! Runs grasp searches on the threads of the executor.

mod either_hand;
mod evaluate;
mod find;
mod hand_mesh;
mod holdout;
mod job;
mod judge;
mod on_executor;
mod progress;
mod slices;
#[cfg(test)]
mod verdict_tests;

pub(crate) use evaluate::{EvaluateJob, evaluate};
pub(crate) use find::find;
pub(crate) use job::FindJob;
pub(crate) use judge::{JudgeJob, judge};
