//! Checks how long a search may take, and how many attempts it may run.

use std::time::Duration;

use grasp_proto::v1;
use grasp_synthesis::model::strategy::Choice;

use super::Field;

/// Largest index of an attempt: 146,000 years at a million attempts per second.
const LAST_ATTEMPT: u64 = (1 << 62) - 1;

/// Largest number of seconds in a `google.protobuf.Duration`: 10,000 years.
const LONGEST_DURATION_SECONDS: u64 = 315_576_000_000;

/// Longest improvement time: longer ones would keep clients waiting that asked for the first grasp.
const LONGEST_IMPROVEMENT: Duration = Duration::from_secs(1);

/// Budget for `GRASP_CHOICE_BEST_WITHIN_BUDGET` if the request names none: a third of a frame at 60 Hz. A longer one finds
/// better grasps. If there is no grasp by then, the search continues for the first one.
const BEST_CHOICE_BUDGET: Duration = Duration::from_millis(5);

/// Limits of a search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchLimits {
    /// Requested budget.
    pub budget: Option<Duration>,
    /// Requested time for improving a first valid grasp, at most [`LONGEST_IMPROVEMENT`].
    pub improvement: Option<Duration>,
    /// True if the search continues for a first grasp when the budget ends without one: the request wants the best
    /// grasp and names no budget.
    pub is_patient: bool,
    /// Index of the first attempt.
    pub first_attempt: u64,
    /// Largest number of attempts.
    pub max_attempts: u64,
}

/// The limits of a request.
pub(super) fn search_limits(field: Field<'_>, sent: &v1::SearchOptions, choice: Choice) -> SearchLimits {
    let is_patient = choice == Choice::BestWithinBudget && sent.budget.is_none();
    let budget = match sent.budget {
        Some(budget) => positive_duration(field.child("budget"), budget),
        None => is_patient.then_some(BEST_CHOICE_BUDGET),
    };
    let improvement = sent
        .refinement_time
        .and_then(|sent| duration(field.child("refinement_time"), sent))
        .map(|sent| sent.min(LONGEST_IMPROVEMENT));
    let (first_attempt, max_attempts) = attempts(field, sent);
    SearchLimits {
        budget,
        improvement,
        is_patient,
        first_attempt,
        max_attempts,
    }
}

/// Index of the first attempt, and the number of attempts.
fn attempts(field: Field<'_>, sent: &v1::SearchOptions) -> (u64, u64) {
    if sent.max_attempts == Some(0) {
        field.child("max_attempts").add("is 0; it must be at least 1");
    }
    match sent.replay_attempt {
        Some(only) => {
            if only > LAST_ATTEMPT {
                field
                    .child("replay_attempt")
                    .add(format_args!("is {only}; it must be at most {LAST_ATTEMPT}"));
            }
            (only, 1)
        }
        None => (0, sent.max_attempts.unwrap_or(LAST_ATTEMPT).min(LAST_ATTEMPT)),
    }
}

/// A duration of more than 0.
pub(super) fn positive_duration(field: Field<'_>, sent: prost_types::Duration) -> Option<Duration> {
    let duration = duration(field, sent)?;
    if duration.is_zero() {
        return field.reject("is 0 s and 0 ns; it must be more than 0");
    }
    Some(duration)
}

/// A duration of at least 0.
pub(super) fn duration(field: Field<'_>, sent: prost_types::Duration) -> Option<Duration> {
    let text = || format!("{} s and {} ns", sent.seconds, sent.nanos);
    let in_range =
        sent.seconds.unsigned_abs() <= LONGEST_DURATION_SECONDS && sent.nanos.unsigned_abs() < 1_000_000_000;
    let one_sign = i64::from(sent.nanos.signum()) * sent.seconds.signum() >= 0;
    if !in_range || !one_sign {
        return field.reject(format_args!(
            "is {}, which is not a valid google.protobuf.Duration",
            text()
        ));
    }
    if let (Ok(seconds), Ok(nanos)) = (u64::try_from(sent.seconds), u32::try_from(sent.nanos)) {
        return Some(Duration::new(seconds, nanos));
    }
    field.reject(format_args!("is {}; it must not be negative", text()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::Violations;

    #[test]
    fn refinement_may_be_none_and_is_at_most_a_second() {
        let limits = |seconds, nanos| {
            let violations = Violations::default();
            let sent = v1::SearchOptions {
                refinement_time: Some(prost_types::Duration { seconds, nanos }),
                ..Default::default()
            };
            let limits = search_limits(violations.field("search"), &sent, Choice::FirstValid);
            (limits.improvement, violations.into_listed())
        };
        for (seconds, nanos, expected) in [
            (0, 0, Duration::ZERO),
            (0, 3_000_000, Duration::from_millis(3)),
            (60, 0, LONGEST_IMPROVEMENT),
        ] {
            let (improvement, violations) = limits(seconds, nanos);
            assert!(violations.is_empty());
            assert_eq!(improvement, Some(expected));
        }
        let (_, violations) = limits(-1, 0);
        assert_eq!(violations[0].field, "search.refinement_time");
        assert_eq!(
            violations[0].description,
            "is -1 s and 0 ns; it must not be negative"
        );
    }
}
