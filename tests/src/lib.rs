//! What the integration tests, experiments and benches share: a server inside the process, recorded hands and the
//! placing of givers.

pub mod giver;
mod harness;
pub mod recorded;
pub mod searches;

pub use harness::{StoppingServer, TestServer};
