//! Locks, tasks and waits. Under `--cfg shuttle` they are those of a scheduler with which tests run them in many orders.

#[cfg(shuttle)]
pub(crate) mod orders;

#[cfg(not(shuttle))]
pub(crate) use std::sync::{Mutex, MutexGuard};

#[cfg(not(shuttle))]
pub(crate) use tokio::{
    task::{JoinSet, spawn_blocking},
    time::timeout,
};

#[cfg(shuttle)]
pub(crate) use self::orders::{JoinSet, Mutex, MutexGuard, spawn_blocking, timeout, wait_for};

/// The content of a mutex, even of a poisoned one: no code leaves half a change when it panics.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Waits for a future, on a thread that may block.
///
/// # Panics
/// Outside the context of an async runtime, or on a thread that runs its tasks.
#[cfg(not(shuttle))]
pub(crate) fn wait_for<T>(future: impl Future<Output = T>) -> T {
    tokio::runtime::Handle::current().block_on(future)
}
