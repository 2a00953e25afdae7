//! Runs grasp searches on the threads of the executor.

mod either_hand;
mod find;
mod hand_mesh;
mod holdout;
mod job;
mod progress;
mod slices;
mod stream;

pub(crate) use find::find;
pub(crate) use job::{Answered, FindJob};
pub(crate) use stream::{Found, Stream, Wanted};
