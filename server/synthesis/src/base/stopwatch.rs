//! Times the steps of Algorithm 1, at no cost when timing is off.

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

/// The time spent in each step of Algorithm 1, summed over attempts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepTimes {
    /// Step 1.
    pub wrist_placement: Duration,
    /// Step 2.
    pub finger_posing: Duration,
    /// Step 3.
    pub collision_validation: Duration,
    /// Step 4.
    pub contact_validation: Duration,
    /// Step 5.
    pub immobility_validation: Duration,
}

impl StepTimes {
    fn step_mut(&mut self, step: Step) -> &mut Duration {
        match step {
            Step::WristPlacement => &mut self.wrist_placement,
            Step::FingerPosing => &mut self.finger_posing,
            Step::CollisionValidation => &mut self.collision_validation,
            Step::ContactValidation => &mut self.contact_validation,
            Step::ImmobilityValidation => &mut self.immobility_validation,
        }
    }

    /// Adds the times of another worker.
    pub fn add(&mut self, other: &Self) {
        self.wrist_placement += other.wrist_placement;
        self.finger_posing += other.finger_posing;
        self.collision_validation += other.collision_validation;
        self.contact_validation += other.contact_validation;
        self.immobility_validation += other.immobility_validation;
    }
}

/// Receives a call when an attempt starts and when each of its steps ends.
pub trait Stopwatch {
    /// Marks the start of an attempt.
    fn start(&mut self);

    /// Marks the end of the step that has run since the last call.
    fn lap(&mut self, step: Step);

    /// The recorded times; none if this stopwatch does not record.
    fn times(&self) -> Option<StepTimes>;
}

/// Records nothing; its calls compile to nothing.
#[derive(Clone, Copy, Debug)]
pub struct NoStopwatch;

impl Stopwatch for NoStopwatch {
    #[inline]
    fn start(&mut self) {}

    #[inline]
    fn lap(&mut self, _step: Step) {}

    fn times(&self) -> Option<StepTimes> {
        None
    }
}

/// Records times by a clock.
#[derive(Clone, Copy)]
pub struct StepStopwatch<'a> {
    clock: &'a dyn Clock,
    last: Duration,
    times: StepTimes,
}

impl<'a> StepStopwatch<'a> {
    /// A stopwatch with all times at zero.
    pub fn new(clock: &'a dyn Clock) -> Self {
        Self {
            clock,
            last: clock.now(),
            times: StepTimes::default(),
        }
    }
}

impl Stopwatch for StepStopwatch<'_> {
    fn start(&mut self) {
        self.last = self.clock.now();
    }

    fn lap(&mut self, step: Step) {
        let now = self.clock.now();
        *self.times.step_mut(step) += now.saturating_sub(self.last);
        self.last = now;
    }

    fn times(&self) -> Option<StepTimes> {
        Some(self.times)
    }
}
