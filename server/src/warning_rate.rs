//! Bounds how often the log has a warning that clients can cause.

use std::{
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

/// Number of warnings that may come at once.
const BURST: u32 = 10;

/// Time after which another one may come.
const EVERY: Duration = Duration::from_secs(10);

/// Lets ten warnings of a kind pass at once, and later one every ten seconds.
#[derive(Debug)]
pub(crate) struct WarningRate(Mutex<State>);

#[derive(Debug)]
struct State {
    left: u32,
    /// Since when the next one is saved up.
    since: Instant,
    unlogged: u64,
}

impl Default for WarningRate {
    fn default() -> Self {
        Self(Mutex::new(State {
            left: BURST,
            since: Instant::now(),
            unlogged: 0,
        }))
    }
}

impl WarningRate {
    /// Whether a warning is to be logged, with the number of those since the last one that were not.
    pub(crate) fn pass(&self) -> Option<u64> {
        self.pass_at(Instant::now())
    }

    fn pass_at(&self, now: Instant) -> Option<u64> {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = now.saturating_duration_since(state.since);
        let earned = (waited.as_millis() / EVERY.as_millis()).min(u128::from(BURST - state.left)) as u32;
        state.left += earned;
        // At the most, nothing is saved up.
        state.since = if state.left == BURST {
            now
        } else {
            state.since + EVERY * earned
        };
        if state.left == 0 {
            state.unlogged += 1;
            return None;
        }
        state.left -= 1;
        Some(std::mem::take(&mut state.unlogged))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_is_logged_seldom_and_counted() {
        let rate = WarningRate::default();
        let start = Instant::now();
        let passed: Vec<u64> = (0..1000).filter_map(|_| rate.pass_at(start)).collect();
        assert_eq!(passed, [0; BURST as usize]);
        let later = start + EVERY;
        assert_eq!([rate.pass_at(later), rate.pass_at(later)], [Some(990), None]);
        // After a long quiet, no more than at first.
        let late = start + 1000 * EVERY;
        let passed: Vec<u64> = (0..1000).filter_map(|_| rate.pass_at(late)).collect();
        assert_eq!(passed.len(), BURST as usize);
        assert_eq!(passed[0], 1);
    }
}
