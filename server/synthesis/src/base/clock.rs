//! The clock that the caller supplies.

use std::time::Duration;

/// A monotonic clock. The crate never reads the system's time itself.
pub trait Clock: Sync {
    /// Time since a fixed origin, chosen by the clock; never decreases.
    fn now(&self) -> Duration;
}
