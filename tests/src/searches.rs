//! What searches without a server need: a clock, and prepared objects.

use std::{
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant},
};

use grasp_synthesis::{base::clock::Clock, model::object::GraspObject, propose::prepared::PreparedObject};

/// The machine's monotonic clock.
pub struct MonotonicClock(Instant);

impl Default for MonotonicClock {
    fn default() -> Self {
        Self(Instant::now())
    }
}

impl Clock for MonotonicClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

/// An object with what proposals derive from it, derived once for all that ask.
pub fn prepared(object: &Arc<GraspObject>) -> Arc<PreparedObject> {
    static PREPARED: Mutex<Vec<Arc<PreparedObject>>> = Mutex::new(Vec::new());
    let mut all = PREPARED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = all.iter().find(|known| Arc::ptr_eq(known.object(), object)) {
        return Arc::clone(known);
    }
    let new = Arc::new(PreparedObject::new(Arc::clone(object)));
    all.push(Arc::clone(&new));
    new
}
