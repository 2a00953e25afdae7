//! Times the steps of Algorithm 1.

use std::time::Duration;

use super::clock::Clock;

/// The steps of Algorithm 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Step 1.
    WristPlacement,
    /// Step 2.
    FingerPosing,
    /// Step 3.
    CollisionValidation,
    /// Step 4.
    ContactValidation,
    /// Step 5.
    ImmobilityValidation,
}

/// The time spent in each [`Step`], in their order, summed over attempts.
pub type StepTimes = [Duration; 5];

/// Records the time of each step, or nothing.
#[derive(Clone, Copy)]
pub struct Stopwatch<'a> {
    /// `None` if it is off.
    clock: Option<&'a dyn Clock>,
    last: Duration,
    times: StepTimes,
}

impl<'a> Stopwatch<'a> {
    /// A stopwatch that records nothing.
    pub const fn off() -> Self {
        Self {
            clock: None,
            last: Duration::ZERO,
            times: [Duration::ZERO; 5],
        }
    }

    /// A stopwatch with all times at zero.
    pub fn new(clock: &'a dyn Clock) -> Self {
        Self {
            clock: Some(clock),
            last: clock.now(),
            ..Self::off()
        }
    }

    /// Marks the start of an attempt.
    #[inline]
    pub fn start(&mut self) {
        if let Some(clock) = self.clock {
            self.last = clock.now();
        }
    }

    /// Marks the end of the step that has run since the last call.
    #[inline]
    pub fn lap(&mut self, step: Step) {
        if let Some(clock) = self.clock {
            let now = clock.now();
            self.times[step as usize] += now.saturating_sub(self.last);
            self.last = now;
        }
    }

    /// The recorded times; `None` if it is off.
    pub fn times(&self) -> Option<StepTimes> {
        self.clock.map(|_| self.times)
    }
}
