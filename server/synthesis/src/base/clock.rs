//! The clock that is handed in.

use std::time::Duration;

/// A monotonic clock. The crate reads no other.
pub trait Clock: Sync {
    /// Time since an origin that does not change while the clock lives.
    fn now(&self) -> Duration;
}
