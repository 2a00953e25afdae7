//! Shared by integration tests and benches: a server inside the process, recorded hands, placed givers, and random
//! holdouts.

mod harness;
#[cfg(test)]
mod pairs;
pub mod random_holdouts;
pub mod recorded;

pub use harness::{StoppingServer, TestServer, wire_pose};
