//! Shares a server between its clients: [`Places`] bound how much of something they hold, and a [`Gate`] decides whose turn it is at
//! the workers, and which job would be too late.
//!
//! Nothing here knows of calls, or of what the workers do.

mod gate;
mod places;
mod turns;

pub use gate::{Gate, Job, TooLate};
pub use places::{Full, Place, Places, may_hold_another};

/// Locks as the tests of orders need them.
mod sync {
    #[cfg(not(shuttle))]
    pub(crate) use std::sync::{
        Condvar, Mutex, MutexGuard,
        atomic::{AtomicBool, Ordering},
    };

    #[cfg(shuttle)]
    pub(crate) use shuttle::sync::{
        Condvar, Mutex, MutexGuard,
        atomic::{AtomicBool, Ordering},
    };

    /// The content of a mutex, even of a poisoned one: no code leaves half a change when it panics.
    pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
        mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

/// The identity of a client.
pub trait Client: Clone + Eq + std::hash::Hash {}

impl<T: Clone + Eq + std::hash::Hash> Client for T {}
