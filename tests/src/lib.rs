//! Shared by integration tests and benches: a server inside the process, recorded hands, placed givers, random holdouts,
//! labelled pairs of grasps and progress bars.

pub mod giver;
mod harness;
pub mod pairs;
pub mod progress;
pub mod random_holdouts;
pub mod recorded;
pub mod searches;

pub use harness::{StoppingServer, TestServer, wire_pose};
