//! Processor time of a search as its duration on an idle machine.
//!
//! The coordinating thread works alone before it wakes the workers, so its time counts in full; the rest is divided
//! evenly among the workers.

use std::{cell::Cell, time::Duration};

use grasp_synthesis::base::clock::Clock;

use crate::figures::core::{process_time, thread_time};

thread_local! {
    /// Whether this thread waits for workers.
    static COORDINATES: Cell<bool> = const { Cell::new(false) };
}

/// A clock that starts with a search.
pub(super) struct ProcessorClock {
    workers: u32,
    coordinator_start: Duration,
    process_start: Duration,
}

impl ProcessorClock {
    /// Starts on the thread that waits for `workers` other threads.
    pub(super) fn start(workers: usize) -> Self {
        COORDINATES.set(true);
        Self {
            workers: workers as u32,
            coordinator_start: thread_time(),
            process_start: process_time(),
        }
    }

    /// The time so far. Must be called on the waiting thread.
    pub(super) fn total(&self) -> Duration {
        let of_coordinator = self.of_coordinator();
        let of_workers = self.of_process().saturating_sub(of_coordinator);
        of_coordinator + of_workers / self.workers
    }

    fn of_coordinator(&self) -> Duration {
        thread_time().saturating_sub(self.coordinator_start)
    }

    fn of_process(&self) -> Duration {
        process_time().saturating_sub(self.process_start)
    }
}

impl Clock for ProcessorClock {
    fn now(&self) -> Duration {
        if COORDINATES.get() {
            self.of_coordinator()
        } else {
            self.of_process() / self.workers
        }
    }
}
