//! How much an object's atlas is asked for.

use std::time::Duration;

/// Time after which a call counts half.
const HALF_LIFE: Duration = Duration::from_mins(5);

/// A decayed count of calls. It is kept as the binary logarithm of what the count would be had calls from the clock's start
/// on grown instead of decayed: all counts decay alike, so that comparing them needs no clock.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(crate) struct Demand(f64);

impl Default for Demand {
    fn default() -> Self {
        Self::NONE
    }
}

impl Demand {
    /// Never asked for.
    pub(crate) const NONE: Self = Self(f64::NEG_INFINITY);

    /// More than any other.
    pub(crate) const MOST: Self = Self(f64::INFINITY);

    /// One call more, at a time since the clock's start.
    #[must_use]
    pub(crate) fn with_call(self, at: Duration) -> Self {
        let call = at.as_secs_f64() / HALF_LIFE.as_secs_f64();
        let (more, less) = (self.0.max(call), self.0.min(call));
        Self(more + (less - more).exp2().ln_1p() / std::f64::consts::LN_2)
    }

    /// A share of the calls, more than 0.
    #[must_use]
    pub(crate) fn share(self, of_calls: f64) -> Self {
        Self(self.0 + of_calls.log2())
    }

    /// Orders demands, none first.
    pub(crate) fn cmp(self, other: Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The count itself, with each call halved as often as half-lives have passed by `now`.
    fn count(calls: &[Duration], now: Duration) -> f64 {
        let age = |at: &Duration| (now.as_secs_f64() - at.as_secs_f64()) / HALF_LIFE.as_secs_f64();
        calls.iter().map(|at| (-age(at)).exp2()).sum()
    }

    fn demand(calls: &[Duration]) -> Demand {
        calls.iter().fold(Demand::NONE, |sum, &at| sum.with_call(at))
    }

    #[test]
    fn orders_like_counts_that_decay() {
        let seconds =
            |calls: &[u64]| -> Vec<Duration> { calls.iter().map(|&at| Duration::from_secs(at)).collect() };
        let now = Duration::from_secs(100_000);
        let all = [
            seconds(&[0; 40]),
            seconds(&[99_990]),
            seconds(&[99_000, 99_100, 99_200]),
            seconds(&[98_000, 99_500, 99_980]),
            seconds(&[99_990, 99_991]),
        ];
        for (a, b) in all.iter().flat_map(|a| all.iter().map(move |b| (a, b))) {
            let expected = count(a, now).total_cmp(&count(b, now));
            assert_eq!(demand(a).cmp(demand(b)), expected, "{a:?} {b:?}");
        }
        let shared = demand(&all[4]).share(0.25);
        let expected = demand(&all[4][..1]).share(0.5);
        assert!((shared.0 - expected.0).abs() < 0.01, "{shared:?} {expected:?}");
        assert!(Demand::NONE < demand(&all[0]) && demand(&all[4]) < Demand::MOST);
    }

    #[test]
    fn a_call_counts_half_after_a_half_life() {
        let early = demand(&[Duration::ZERO; 4]);
        let late = demand(&[HALF_LIFE; 2]);
        assert!((early.0 - late.0).abs() < 1e-12, "{early:?} {late:?}");
    }
}
