//! From async calls to the threads that search, and back.

pub(crate) mod executor;
pub(crate) mod job;
mod race;
