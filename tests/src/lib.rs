//! Shared by integration tests and benches: a server inside the process, recorded hands, placed givers, random holdouts,
//! labelled pairs of grasps and progress bars.

pub mod giver;
mod harness;
pub mod pairs;
pub mod progress;
pub mod random_holdouts;
pub mod recorded;
pub mod searches;
mod wire;

pub use harness::{StoppingServer, TestServer};
pub use wire::wire_pose;
