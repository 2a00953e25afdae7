//! The part of a call's deadline that is kept for the answer.

use std::{
    sync::atomic::{AtomicU64, Ordering},
    time::{Duration, Instant},
};

/// Reserve over measured delay. The server sees only the delay from the end of the search until the transport has the
/// answer; as much again is for the ways from and to the client, on a machine that may be as busy.
const MARGIN: f64 = 2.0;

/// Time after which a measured delay counts half. Longer ones remember rarer delays; shorter ones give searches their
/// time back sooner after a load has ended.
const HALF_LIFE: Duration = Duration::from_secs(10);

/// Delays count up to this long: longer ones are a stall, not a load, and would take minutes to forget.
const MAX_DELAY: Duration = Duration::from_secs(1);

/// Keeps a multiple of recent delays, but no less than a minimum. A delay counts at once, and less as time passes: what
/// counts is the largest of all delays, each halved for every [`HALF_LIFE`] since.
#[derive(Debug)]
pub(crate) struct DeadlineReserve {
    minimum: Duration,
    epoch: Instant,
    /// The largest of log₂ of a delay in microseconds plus its time since the epoch in half-lives, as the bits of an
    /// `f64`. The order of decayed delays is that of these sums, at any time; that of the bits, too, as no sum is
    /// negative.
    level: AtomicU64,
}

impl DeadlineReserve {
    /// A reserve before any delay was measured. Times before `epoch` count as `epoch`.
    pub(crate) fn new(minimum: Duration, epoch: Instant) -> Self {
        Self {
            minimum,
            epoch,
            level: AtomicU64::new(0),
        }
    }

    /// Adds a delay that was measured at a time.
    pub(crate) fn record(&self, delay: Duration, at: Instant) {
        let delay_us = microseconds(delay.min(MAX_DELAY)).max(1.0);
        let level = delay_us.log2() + self.half_lives_until(at);
        self.level.fetch_max(level.to_bits(), Ordering::Relaxed);
    }

    /// The reserve at a time.
    pub(crate) fn at(&self, time: Instant) -> Duration {
        let level = f64::from_bits(self.level.load(Ordering::Relaxed));
        // A delay recorded by another thread may be of a later time than this: it must not exceed the longest either.
        let delay_us = (level - self.half_lives_until(time))
            .exp2()
            .min(microseconds(MAX_DELAY));
        Duration::from_secs_f64(1e-6 * MARGIN * delay_us).max(self.minimum)
    }

    fn half_lives_until(&self, time: Instant) -> f64 {
        time.saturating_duration_since(self.epoch).as_secs_f64() / HALF_LIFE.as_secs_f64()
    }
}

fn microseconds(time: Duration) -> f64 {
    1e6 * time.as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINIMUM: Duration = Duration::from_millis(5);

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// Equal to within a microsecond.
    fn assert_close(reserve: Duration, expected: Duration) {
        assert!(
            reserve.abs_diff(expected) <= Duration::from_micros(1),
            "{reserve:?} instead of {expected:?}"
        );
    }

    #[test]
    fn is_the_minimum_while_delays_are_short() {
        let start = Instant::now();
        let reserve = DeadlineReserve::new(MINIMUM, start);
        assert_eq!(reserve.at(start), MINIMUM);
        reserve.record(ms(2), start);
        reserve.record(Duration::ZERO, start);
        assert_eq!(reserve.at(start), MINIMUM);
        assert_eq!(reserve.at(start + HALF_LIFE * 1000), MINIMUM);
    }

    #[test]
    fn rises_at_once_with_the_longest_delay() {
        let start = Instant::now();
        let reserve = DeadlineReserve::new(MINIMUM, start);
        let now = start + ms(500);
        for (delay, expected) in [(10, 20), (40, 80), (10, 80), (0, 80)] {
            reserve.record(ms(delay), now);
            assert_close(reserve.at(now), ms(expected));
        }
    }

    #[test]
    fn halves_with_each_half_life_down_to_the_minimum() {
        let start = Instant::now();
        let reserve = DeadlineReserve::new(MINIMUM, start);
        reserve.record(ms(40), start);
        for (half_lives, expected) in [(0, 80), (1, 40), (2, 20), (3, 10), (4, 5), (5, 5), (100, 5)] {
            assert_close(reserve.at(start + HALF_LIFE * half_lives), ms(expected));
        }
    }

    #[test]
    fn keeps_the_delay_that_counts_most() {
        // Against every delay decayed on its own.
        let start = Instant::now();
        let reserve = DeadlineReserve::new(Duration::ZERO, start);
        let recorded = [
            (0, 400),
            (3, 10),
            (9, 300),
            (25, 50),
            (26, 130),
            (60, 1),
            (200, 20),
        ];
        for (place, (second, delay)) in recorded.into_iter().enumerate() {
            let now = start + Duration::from_secs(second);
            reserve.record(ms(delay), now);
            let decayed = recorded[..=place].iter().map(|&(since, delay)| {
                let age = (second - since) as f64;
                0.001 * delay as f64 * 0.5_f64.powf(age / HALF_LIFE.as_secs_f64())
            });
            let largest = decayed.fold(0.0, f64::max);
            assert_close(reserve.at(now), Duration::from_secs_f64(MARGIN * largest));
        }
    }

    #[test]
    fn a_stall_counts_no_more_than_the_longest_delay() {
        let start = Instant::now();
        let reserve = DeadlineReserve::new(MINIMUM, start);
        reserve.record(Duration::MAX, start);
        assert_close(reserve.at(start), MAX_DELAY.mul_f64(MARGIN));
        // Also if it was recorded after the time that is asked for.
        reserve.record(Duration::MAX, start + HALF_LIFE * 2000);
        assert_close(reserve.at(start), MAX_DELAY.mul_f64(MARGIN));
        assert_eq!(reserve.at(start + HALF_LIFE * 2010), MINIMUM);
    }

    #[test]
    fn forgets_after_years_of_uptime_as_after_seconds() {
        let start = Instant::now();
        let reserve = DeadlineReserve::new(MINIMUM, start);
        let later = start + Duration::from_hours(24 * 3650);
        reserve.record(ms(40), later);
        assert_close(reserve.at(later), ms(80));
        assert_close(reserve.at(later + HALF_LIFE), ms(40));
    }
}
