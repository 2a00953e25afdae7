//! The time budget of a search, and the part of a call's deadline that is kept for the answer.

use std::{
    sync::atomic::{AtomicU64, Ordering},
    time::{Duration, Instant},
};

/// The server's limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BudgetLimits {
    /// Budget of a request that names none.
    pub default: Duration,
    /// Largest budget.
    pub maximum: Duration,
    /// Smallest part of a call's deadline reserved for the response.
    pub minimum_reserve: Duration,
}

/// Shortest timeout that clients of gRPC's C++ core (Python, Ruby, PHP …) round up to three digits: they may end the
/// call up to 1 % before the deadline that they send.
const ROUNDED_FROM: Duration = Duration::from_secs(1);

/// The effective budget: the smallest of the requested one (or the default), the server's maximum, and the call's
/// deadline less the reserve in force. It counts from the call's arrival, so waiting for a free worker uses it up. The
/// search has at least a quarter of the deadline: known grips are tried in less, and under load the way back may need the
/// rest.
pub(crate) fn effective_budget(
    requested: Option<Duration>,
    limits: BudgetLimits,
    reserve: Duration,
    arrived: Instant,
    deadline: Option<Instant>,
) -> Duration {
    let wanted = requested.unwrap_or(limits.default).min(limits.maximum);
    match deadline {
        None => wanted,
        Some(deadline) => {
            let allowed = deadline.saturating_duration_since(arrived);
            let rounding = if allowed >= ROUNDED_FROM {
                allowed / 100
            } else {
                Duration::ZERO
            };
            let left = allowed
                .saturating_sub(reserve.saturating_add(rounding))
                .max(allowed / 4);
            wanted.min(left)
        }
    }
}

/// Parses a `grpc-timeout` header: up to eight digits and a unit (H, M, S, m, u or n). `None` if the header is malformed;
/// such a call has no deadline, as without the header.
pub(crate) fn parse_grpc_timeout(header: &str) -> Option<Duration> {
    let (digits, unit) = header.split_at_checked(header.len().checked_sub(1)?)?;
    if digits.is_empty() || digits.len() > 8 || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let value: u64 = digits.parse().ok()?;
    match unit {
        "H" => Some(Duration::from_secs(value * 3600)),
        "M" => Some(Duration::from_secs(value * 60)),
        "S" => Some(Duration::from_secs(value)),
        "m" => Some(Duration::from_millis(value)),
        "u" => Some(Duration::from_micros(value)),
        "n" => Some(Duration::from_nanos(value)),
        _ => None,
    }
}

/// Reserve over measured delay: the server does not see the ways from and to the client, which may take as long.
const MARGIN: f64 = 2.0;

/// Time after which a measured delay counts half.
const HALF_LIFE: Duration = Duration::from_secs(10);

/// Longest delay that counts: longer ones are a stall, not a load, and would take minutes to forget.
const MAX_DELAY: Duration = Duration::from_secs(1);

/// Keeps a multiple of recent delays, but no less than a minimum. The largest of all delays counts, each halved for
/// every [`HALF_LIFE`] since.
#[derive(Debug)]
pub(crate) struct DeadlineReserve {
    minimum: Duration,
    epoch: Instant,
    /// The largest sum of log₂ of a delay in microseconds and its time since the epoch in half-lives, as the bits of an `f64`. Sums
    /// order like decayed delays at any time, and bits like sums, because none is negative.
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

    const LIMITS: BudgetLimits = BudgetLimits {
        default: Duration::from_secs(1),
        maximum: Duration::from_secs(10),
        minimum_reserve: Duration::from_millis(5),
    };

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    #[test]
    fn budget_is_the_smallest_limit() {
        let arrived = Instant::now();
        let reserves = [5, 30, 40, u64::MAX];
        let [short, long, longer, endless] = reserves.map(ms);
        // The reserve, the requested budget, the deadline and the budget, in milliseconds.
        for (reserve, requested, deadline, expected) in [
            (short, None, None, 1000),
            (short, Some(20), None, 20),
            (short, Some(60_000), None, 10_000),
            (short, None, Some(16), 11),
            (short, Some(8), Some(16), 8),
            // A deadline of seconds may be rounded up by 1 %.
            (short, Some(9000), Some(2000), 1975),
            // A quarter of a deadline is left.
            (short, None, Some(4), 1),
            (longer, None, Some(48), 12),
            (endless, None, Some(2000), 500),
            (short, None, Some(0), 0),
            (long, None, Some(200), 170),
            (long, Some(20), Some(200), 20),
            (long, None, None, 1000),
        ] {
            let deadline = deadline.map(|deadline| arrived + ms(deadline));
            let budget = effective_budget(requested.map(ms), LIMITS, reserve, arrived, deadline);
            assert_eq!(budget, ms(expected), "{reserve:?} {requested:?} {deadline:?}");
        }
    }

    #[test]
    fn timeouts_have_a_unit_and_up_to_eight_digits() {
        for (header, expected) in [
            ("3H", Duration::from_hours(3)),
            ("2M", Duration::from_mins(2)),
            ("42S", Duration::from_secs(42)),
            ("100m", ms(100)),
            ("7u", Duration::from_micros(7)),
            ("99999999n", Duration::from_nanos(99_999_999)),
        ] {
            assert_eq!(parse_grpc_timeout(header), Some(expected));
        }
        for header in [
            "",
            "S",
            "1",
            "123456789S",
            "-1S",
            "1.5S",
            "1s",
            "1 S",
            "0x1S",
            "1é",
        ] {
            assert_eq!(parse_grpc_timeout(header), None, "{header}");
        }
    }

    /// Equal to within a microsecond.
    fn assert_close(reserve: Duration, expected: Duration) {
        let difference = reserve.abs_diff(expected);
        assert!(difference <= Duration::from_micros(1), "{reserve:?} {expected:?}");
    }

    #[test]
    fn reserve_halves_with_each_half_life_down_to_the_minimum() {
        let start = Instant::now();
        // After years of uptime as after seconds.
        for recorded in [start, start + Duration::from_hours(24 * 3650)] {
            let reserve = DeadlineReserve::new(LIMITS.minimum_reserve, start);
            reserve.record(ms(2), recorded);
            assert_eq!(reserve.at(recorded), LIMITS.minimum_reserve);
            reserve.record(ms(40), recorded);
            for (half_lives, expected) in [(0, 80), (1, 40), (2, 20), (3, 10), (4, 5), (5, 5), (100, 5)] {
                assert_close(reserve.at(recorded + HALF_LIFE * half_lives), ms(expected));
            }
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
        let reserve = DeadlineReserve::new(LIMITS.minimum_reserve, start);
        // Also if it is recorded after the requested time.
        for recorded in [start, start + HALF_LIFE * 2000] {
            reserve.record(Duration::MAX, recorded);
            assert_close(reserve.at(start), MAX_DELAY.mul_f64(MARGIN));
        }
    }
}
