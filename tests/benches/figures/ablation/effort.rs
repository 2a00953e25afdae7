//! Processor time of a search, as the time that it takes on an idle machine.
//!
//! The coordinating thread works alone before workers are woken, so that its time counts whole; of the workers, who share
//! the rest, each has done an even part of it.

use std::{cell::Cell, time::Duration};

use grasp_synthesis::base::clock::Clock;

use crate::core::thread_time;

thread_local! {
    /// Does this thread wait for workers?
    static COORDINATES: Cell<bool> = const { Cell::new(false) };
}

/// A clock that starts with a search.
pub(super) struct Effort {
    workers: u32,
    coordinator_start: Duration,
    process_start: Duration,
}

impl Effort {
    /// Starts on the thread that waits for `workers` others.
    pub(super) fn start(workers: usize) -> Self {
        COORDINATES.set(true);
        Self {
            workers: workers as u32,
            coordinator_start: thread_time(),
            process_start: process_time(),
        }
    }

    /// The time so far, asked for on the thread that waits.
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

impl Clock for Effort {
    fn now(&self) -> Duration {
        if COORDINATES.get() {
            self.of_coordinator()
        } else {
            self.of_process() / self.workers
        }
    }
}

/// Processor time of all threads.
#[cfg(target_os = "linux")]
fn process_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::try_from(time).expect("a process' time is positive")
}

/// Where the system has no such clock, all threads count as busy.
#[cfg(not(target_os = "linux"))]
fn process_time() -> Duration {
    thread_time() * crate::core::WORKERS as u32
}
