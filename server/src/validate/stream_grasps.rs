//! Checks `StreamGraspsRequest`.

use std::time::Duration;

use grasp_proto::v1;
use grasp_synthesis::search::alternatives::Differences;

use super::{Field, FindQuery, Violations, find_query, known};
use crate::{error::ServiceError, rigs::store::RigStore};

/// Largest number of alternatives.
const MOST_ALTERNATIVES: u32 = 32;

/// Default of the rate: as often as a film shows pictures.
const DEFAULT_RATE: f32 = 30.0;

/// Largest rate: more often than any display shows pictures.
const LARGEST_RATE: f32 = 1000.0;

/// Longer than any search: whatever is longer has the same effect.
const LONGEST_INTERVAL: Duration = Duration::from_hours(1);

/// A valid request.
#[derive(Debug)]
pub(crate) struct StreamQuery {
    /// The search for the best grasp.
    pub find: FindQuery,
    /// What is sent of it.
    pub sent: Sent,
}

/// Which grasps are sent.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Sent {
    /// Every better one.
    Better {
        /// Least time between two.
        interval: Duration,
    },
    /// The best ones that differ.
    Alternatives {
        /// At most so many.
        count: usize,
        /// What they differ by.
        by: Differences,
    },
}

/// Checks a request; see [`find_query`] for the parameters.
///
/// # Errors
/// [`ServiceError::Invalid`] with every violation.
pub(crate) fn stream_query(
    request: v1::StreamGraspsRequest,
    rigs: (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<StreamQuery, ServiceError> {
    let mut violations = Violations::default();
    let v = &mut violations;
    let sent = sent(request.most_per_second, request.alternatives, v);
    let Some(mut holdout) = request.holdout else {
        v.add(
            Field::root("holdout"),
            "is missing; it must be the holdout and the search",
        );
        return Err(violations.into_error());
    };
    check_search(&holdout, v);
    // Without a budget, this choice would end after some milliseconds.
    let has_budget = holdout.budget.is_some();
    if v1::Choice::try_from(holdout.choice).is_ok() {
        holdout.set_choice(v1::Choice::BestWithinBudget);
    }
    // Was reported.
    holdout.reproducible = false;
    match find_query(holdout, rigs, object_exists) {
        Ok(mut find) => {
            if !has_budget {
                find.limits.budget = None;
                find.limits.is_patient = false;
            }
            violations.finish(StreamQuery { find, sent })
        }
        Err(ServiceError::Invalid(inner)) => {
            for violation in inner {
                violations.add(
                    Field::root("holdout").child(&violation.field),
                    violation.description,
                );
                violations.unlisted += violation.unlisted;
            }
            Err(violations.into_error())
        }
        Err(other) => Err(other),
    }
}

/// Checks that the search is for the best grasp of one hand.
fn check_search(holdout: &v1::FindGraspRequest, violations: &mut Violations) {
    let parent = Field::root("holdout");
    let mut wrong = |field: &'static str, description: &'static str| {
        violations.add(parent.child(field), description);
    };
    if holdout.choice() == v1::Choice::FirstValid {
        wrong(
            "choice",
            "is CHOICE_FIRST_VALID; it must be CHOICE_BEST_WITHIN_BUDGET or unspecified: a stream goes on after the first grasp",
        );
    }
    if holdout.reproducible {
        wrong(
            "reproducible",
            "is true; it must be false: which grasps are better and when depends on the speed of the machine",
        );
    }
    if holdout.only_attempt.is_some() {
        wrong(
            "only_attempt",
            "is given; it must be absent: one attempt has no better ones",
        );
    }
    if holdout.standing.is_some() {
        wrong(
            "standing",
            "is given; it must be absent: a stream does not hold on to a grasp",
        );
    }
    if holdout.hands() == v1::Hands::Both {
        wrong("hands", "is HANDS_BOTH; it must be HANDS_ONE or unspecified");
    }
}

/// Which grasps are sent.
fn sent(
    most_per_second: Option<f32>,
    alternatives: Option<v1::Alternatives>,
    violations: &mut Violations,
) -> Sent {
    let Some(v1::Alternatives { count, differ_by }) = alternatives else {
        let rate = most_per_second.unwrap_or(DEFAULT_RATE);
        let is_valid = rate > 0.0 && rate <= LARGEST_RATE;
        if !is_valid {
            violations.add(
                Field::root("most_per_second"),
                format_args!("is {rate}; it must be more than 0 and at most {LARGEST_RATE}"),
            );
        }
        let interval = Duration::try_from_secs_f32(1.0 / rate).unwrap_or(LONGEST_INTERVAL);
        return Sent::Better {
            interval: interval.min(LONGEST_INTERVAL),
        };
    };
    let parent = Field::root("alternatives");
    if !(1..=MOST_ALTERNATIVES).contains(&count) {
        violations.add(
            parent.child("count"),
            format_args!("is {count}; it must be 1 to {MOST_ALTERNATIVES}"),
        );
    }
    let mut by = Differences {
        approach: differ_by.is_empty(),
        grasp_type: false,
        region: false,
    };
    let listed = parent.child("differ_by");
    for (place, &value) in differ_by.iter().enumerate() {
        match known(listed.at(place), value, violations) {
            v1::DifferBy::Unspecified | v1::DifferBy::Approach => by.approach = true,
            v1::DifferBy::Type => by.grasp_type = true,
            v1::DifferBy::Region => by.region = true,
        }
    }
    Sent::Alternatives {
        count: count as usize,
        by,
    }
}
