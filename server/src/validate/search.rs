//! Checks `SearchOptions`.

use std::time::Duration;

use grasp_proto::v1;
use grasp_synthesis::model::strategy::Choice;

use super::{Field, duration, known, positive_duration};

/// Largest index of an attempt: 146,000 years at a million attempts per second.
const LAST_ATTEMPT: u64 = (1 << 62) - 1;

/// Longest refinement time: longer ones would keep clients waiting that want the first grasp.
const MAX_REFINEMENT: Duration = Duration::from_secs(1);

/// Budget for `GRASP_CHOICE_BEST_WITHIN_BUDGET` if the request names none: a third of a frame at 60 Hz. A longer one finds
/// better grasps. If there is no grasp by then, the search continues for the first one.
const BEST_CHOICE_BUDGET: Duration = Duration::from_millis(5);

/// Limits of a search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchLimits {
    /// Requested budget.
    pub budget: Option<Duration>,
    /// Requested time for improving a first valid grasp, at most [`MAX_REFINEMENT`].
    pub refinement: Option<Duration>,
    /// True if the search continues for a first grasp when the budget ends without one.
    pub is_patient: bool,
    /// Index of the first attempt.
    pub first_attempt: u64,
    /// Largest number of attempts.
    pub max_attempts: u64,
}

/// How to search.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    pub limits: SearchLimits,
    pub choice: Choice,
    /// True if the indices of the valid attempts must decide.
    pub reproducible: bool,
    pub seed: Option<u64>,
    pub allows_atlas: bool,
    pub is_replay: bool,
}

pub(super) fn search(field: Field<'_>, sent: Option<v1::SearchOptions>) -> Search {
    let sent = sent.unwrap_or_default();
    let choice: v1::GraspChoice = known(field.child("choice"), sent.choice);
    let reproducible = choice == v1::GraspChoice::Reproducible;
    let choice = match choice {
        v1::GraspChoice::Unspecified | v1::GraspChoice::FirstValid | v1::GraspChoice::Reproducible => {
            Choice::FirstValid
        }
        v1::GraspChoice::BestWithinBudget => Choice::BestWithinBudget,
    };
    Search {
        limits: search_limits(field, &sent, choice),
        choice,
        reproducible,
        seed: sent.seed,
        allows_atlas: !sent.ignore_atlas,
        is_replay: sent.replay_attempt.is_some(),
    }
}

/// The limits of a request.
fn search_limits(field: Field<'_>, sent: &v1::SearchOptions, choice: Choice) -> SearchLimits {
    let is_patient = choice == Choice::BestWithinBudget && sent.budget.is_none();
    let budget = match sent.budget {
        Some(budget) => positive_duration(field.child("budget"), budget),
        None => is_patient.then_some(BEST_CHOICE_BUDGET),
    };
    let refinement = sent
        .refinement_time
        .and_then(|sent| duration(field.child("refinement_time"), sent))
        .map(|sent| sent.min(MAX_REFINEMENT));
    let (first_attempt, max_attempts) = attempts(field, sent);
    SearchLimits {
        budget,
        refinement,
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
            (limits.refinement, violations.into_listed())
        };
        for (seconds, nanos, expected) in [
            (0, 0, Duration::ZERO),
            (0, 3_000_000, Duration::from_millis(3)),
            (60, 0, MAX_REFINEMENT),
        ] {
            let (refinement, violations) = limits(seconds, nanos);
            assert!(violations.is_empty());
            assert_eq!(refinement, Some(expected));
        }
        let (_, violations) = limits(-1, 0);
        assert_eq!(violations[0].field, "search.refinement_time");
        assert_eq!(
            violations[0].description,
            "is -1 s and 0 ns; it must not be negative"
        );
    }
}
