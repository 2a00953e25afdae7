//! Retries: on `UNAVAILABLE`, and on `RESOURCE_EXHAUSTED` if the server asks for a wait; with exponential backoff, a bounded number of
//! times, and within the call's deadline. The server may ask for a longer wait (`RetryInfo`), set the wait, or forbid a retry
//! (trailer `grpc-retry-pushback-ms`, gRPC proposal A6).

use std::{
    hash::{BuildHasher as _, RandomState},
    time::Duration,
};

use tonic::{Code, Status};
use tonic_types::StatusExt as _;

/// The trailer with which a server controls retries (gRPC proposal A6).
const PUSHBACK_TRAILER: &str = "grpc-retry-pushback-ms";

/// Relative variation of waits in both directions (gRPC proposal A6); keeps clients that failed together from retrying
/// together.
const JITTER: f64 = 0.2;

/// Number of attempts of a call, and the waits between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RetryPolicy {
    /// Largest number of attempts, the first included; 1 disables retries.
    pub max_attempts: u32,
    /// Wait before the second attempt, varied by up to a fifth.
    pub initial_backoff: Duration,
    /// Longest wait, unless the server asks for more.
    pub max_backoff: Duration,
    /// Factor from one wait to the next; at least 1.
    pub multiplier: f64,
}

impl RetryPolicy {
    /// No retries.
    pub const NEVER: Self = Self {
        max_attempts: 1,
        initial_backoff: Duration::ZERO,
        max_backoff: Duration::ZERO,
        multiplier: 1.0,
    };

    /// The wait after attempt number `attempts`, which ended with `status`; `None` to give up.
    pub(crate) fn wait_after(&self, attempts: u32, status: &Status) -> Option<Duration> {
        if attempts >= self.max_attempts {
            return None;
        }
        if !matches!(status.code(), Code::Unavailable | Code::ResourceExhausted) {
            return None;
        }
        if let Some(value) = status.metadata().get(PUSHBACK_TRAILER) {
            // A negative or unreadable value forbids a retry (A6).
            let milliseconds = value.to_str().ok()?.parse::<u32>().ok()?;
            return Some(Duration::from_millis(milliseconds.into()));
        }
        let details = status.get_error_details();
        let delay = details.retry_info().and_then(|info| info.retry_delay);
        if status.code() == Code::ResourceExhausted && delay.is_none() {
            return None;
        }
        let backoff = self.backoff(attempts, random_fraction());
        Some(backoff.max(delay.unwrap_or_default()))
    }

    /// The wait after `attempts` attempts; `fraction`, from 0 to 1, selects it within the jitter.
    fn backoff(&self, attempts: u32, fraction: f64) -> Duration {
        // The bound on the exponent keeps the product finite; it exceeds any sensible maximum long before.
        let growth = self
            .multiplier
            .max(1.0)
            .powi(attempts.clamp(1, 64).cast_signed() - 1);
        let seconds = (self.initial_backoff.as_secs_f64() * growth).min(self.max_backoff.as_secs_f64());
        let jittered = seconds * (1.0 - JITTER + 2.0 * JITTER * fraction);
        Duration::try_from_secs_f64(jittered).unwrap_or(self.max_backoff)
    }
}

impl Default for RetryPolicy {
    /// Four attempts with waits of about 0.1 s, 0.2 s and 0.4 s: enough for a server that restarts its listener.
    fn default() -> Self {
        Self {
            max_attempts: 4,
            initial_backoff: Duration::from_millis(100),
            max_backoff: Duration::from_secs(2),
            multiplier: 2.0,
        }
    }
}

/// A number from 0 to 1 that differs between processes and calls, from the standard library's randomly keyed hasher.
fn random_fraction() -> f64 {
    f64::from((RandomState::new().hash_one(0_u8) >> 32) as u32) / f64::from(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_grow_to_the_maximum_within_jitter() {
        let policy = RetryPolicy {
            max_attempts: 99,
            ..RetryPolicy::default()
        };
        for (attempts, middle) in [(1, 0.1), (2, 0.2), (3, 0.4), (4, 0.8), (6, 2.0), (90, 2.0)] {
            let shortest = policy.backoff(attempts, 0.0).as_secs_f64();
            let longest = policy.backoff(attempts, 1.0).as_secs_f64();
            for (wait, expected) in [(shortest, 0.8 * middle), (longest, 1.2 * middle)] {
                assert!(
                    (wait - expected).abs() < 1e-6,
                    "{attempts}: {wait} is not {expected}"
                );
            }
        }
    }

    #[test]
    fn only_unavailable_and_busy_servers_are_retried_and_a_bounded_number_of_times() {
        let policy = RetryPolicy::default();
        for code in 0..=16 {
            let status = Status::new(Code::from(code), "");
            let again = policy.wait_after(1, &status).is_some();
            assert_eq!(again, code == 14, "code {code}");
        }
        let busy = tonic_types::ErrorDetails::with_retry_info(Some(Duration::ZERO));
        let busy = Status::with_error_details(Code::ResourceExhausted, "busy", busy);
        assert!(policy.wait_after(1, &busy).is_some());
        let status = Status::unavailable("draining");
        assert!(policy.wait_after(3, &status).is_some());
        assert_eq!(policy.wait_after(4, &status), None);
        assert_eq!(RetryPolicy::NEVER.wait_after(1, &status), None);
    }

    #[test]
    fn pushback_sets_wait_or_stops_and_retry_info_only_lengthens_waits() {
        let policy = RetryPolicy::default();
        let millis = Duration::from_millis;
        for (pushback, attempts, expected) in [
            ("30", 1, Some(millis(30))),
            ("-1", 1, None),
            ("soon", 1, None),
            ("30", 4, None),
        ] {
            let mut status = Status::unavailable("draining");
            status
                .metadata_mut()
                .insert(PUSHBACK_TRAILER, pushback.parse().unwrap());
            assert_eq!(policy.wait_after(attempts, &status), expected, "{pushback}");
        }
        for (delay, longest) in [(millis(5000), millis(5000)), (millis(1), millis(120))] {
            let details = tonic_types::ErrorDetails::with_retry_info(Some(delay));
            let status = Status::with_error_details(Code::Unavailable, "busy", details);
            let wait = policy.wait_after(1, &status).unwrap();
            assert!(wait >= delay.max(millis(80)) && wait <= longest, "{wait:?}");
        }
    }
}
