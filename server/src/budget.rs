//! The time budget of a search.

use std::time::{Duration, Instant};

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

/// Parses a `grpc-timeout` header: up to eight digits and a unit (H, M, S, m, u or n). None if the header is malformed;
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

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: BudgetLimits = BudgetLimits {
        default: Duration::from_secs(1),
        maximum: Duration::from_secs(10),
        minimum_reserve: Duration::from_millis(5),
    };

    fn budget(requested_ms: Option<u64>, deadline_ms: Option<u64>) -> Duration {
        budget_with(LIMITS.minimum_reserve, requested_ms, deadline_ms)
    }

    fn budget_with(reserve: Duration, requested_ms: Option<u64>, deadline_ms: Option<u64>) -> Duration {
        let arrived = Instant::now();
        effective_budget(
            requested_ms.map(Duration::from_millis),
            LIMITS,
            reserve,
            arrived,
            deadline_ms.map(|ms| arrived + Duration::from_millis(ms)),
        )
    }

    #[test]
    fn budget_is_the_smallest_limit() {
        let ms = Duration::from_millis;
        assert_eq!(budget(None, None), ms(1000), "the default");
        assert_eq!(budget(Some(20), None), ms(20), "the request's");
        assert_eq!(budget(Some(60_000), None), ms(10_000), "the maximum");
        assert_eq!(budget(None, Some(16)), ms(11), "the deadline less the reserve");
        assert_eq!(
            budget(Some(8), Some(16)),
            ms(8),
            "the request's below the deadline's"
        );
        assert_eq!(
            budget(Some(9000), Some(2000)),
            ms(1975),
            "a deadline of seconds may be rounded up by 1 %"
        );
        assert_eq!(
            budget(None, Some(4)),
            ms(1),
            "a quarter of a deadline below the reserve"
        );
        assert_eq!(budget(None, Some(0)), ms(0), "a deadline that has passed");
    }

    #[test]
    fn long_reserve_leaves_a_quarter_of_the_deadline() {
        let ms = Duration::from_millis;
        assert_eq!(budget_with(ms(30), None, Some(200)), ms(170));
        assert_eq!(budget_with(ms(40), None, Some(48)), ms(12));
        assert_eq!(budget_with(ms(40), None, Some(8)), ms(2));
        assert_eq!(budget_with(Duration::MAX, None, Some(2000)), ms(500));
        assert_eq!(
            budget_with(ms(30), Some(20), Some(200)),
            ms(20),
            "a requested budget that ends before the reserve is left as it is"
        );
        assert_eq!(budget_with(ms(30), None, None), ms(1000), "without a deadline");
    }

    #[test]
    fn parses_every_unit() {
        assert_eq!(parse_grpc_timeout("3H"), Some(Duration::from_hours(3)));
        assert_eq!(parse_grpc_timeout("2M"), Some(Duration::from_mins(2)));
        assert_eq!(parse_grpc_timeout("42S"), Some(Duration::from_secs(42)));
        assert_eq!(parse_grpc_timeout("100m"), Some(Duration::from_millis(100)));
        assert_eq!(parse_grpc_timeout("7u"), Some(Duration::from_micros(7)));
        assert_eq!(
            parse_grpc_timeout("99999999n"),
            Some(Duration::from_nanos(99_999_999))
        );
    }

    #[test]
    fn rejects_malformed_timeouts() {
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
}
