//! Checks `StreamGraspsRequest`.

use std::time::Duration;

use grasp_proto::v1::{self, stream_grasps_request as request};
use grasp_synthesis::search::report::Differences;

use super::{
    FindQuery, Violations, check_positive, check_within,
    find_grasp::{checked_query, finished},
    known,
};
use crate::{error::ServiceError, rigs::store::RigStore};

/// Largest number of alternatives.
const MAX_ALTERNATIVES: u32 = 32;

/// Default of the rate: as often as a film shows pictures.
const DEFAULT_RATE: f32 = 30.0;

/// Largest rate: more often than any display shows pictures.
const MAX_RATE: f32 = 1000.0;

/// Longer than any search: whatever is longer has the same effect.
const MAX_INTERVAL: Duration = Duration::from_hours(1);

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

/// Checks a request; see [`super::find_query`] for the parameters.
pub(crate) fn stream_query(
    request: v1::StreamGraspsRequest,
    rigs: (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<StreamQuery, ServiceError> {
    let v1::StreamGraspsRequest {
        holdout,
        receiver,
        requirements,
        search,
        output,
        sent,
    } = request;
    let violations = Violations::default();
    let v = &violations;
    let sent = self::sent(sent, v);
    let mut search = search.unwrap_or_default();
    check_search(&search, receiver.as_ref(), v);
    // Without a budget, this choice would end after some milliseconds.
    let has_budget = search.budget.is_some();
    if v1::GraspChoice::try_from(search.choice).is_ok() {
        search.set_choice(v1::GraspChoice::BestWithinBudget);
    }
    let parts = v1::FindGraspRequest {
        holdout,
        receiver,
        requirements,
        search: Some(search),
        output,
        current: None,
    };
    let find = checked_query(parts, rigs, object_exists, v);
    let query = find.map(|mut find| {
        if !has_budget {
            find.limits.budget = None;
            find.limits.is_patient = false;
        }
        StreamQuery { find, sent }
    });
    finished(query, violations)
}

/// Checks that the search is for the best grasp of one hand.
fn check_search(search: &v1::SearchOptions, receiver: Option<&v1::Receiver>, v: &Violations) {
    let field = v.field("search");
    if matches!(
        search.choice(),
        v1::GraspChoice::FirstValid | v1::GraspChoice::Reproducible
    ) {
        field.child("choice").add(format_args!(
                "is {}; it must be GRASP_CHOICE_BEST_WITHIN_BUDGET or unspecified: a stream goes on after the first grasp",
                search.choice().as_str_name()
            ));
    }
    if search.replay_attempt.is_some() {
        field
            .child("replay_attempt")
            .add("is given; it must be absent: one attempt has no better ones");
    }
    check_one_hand(receiver, v);
}

/// Adds a violation if both hands are to take the object.
pub(super) fn check_one_hand(receiver: Option<&v1::Receiver>, v: &Violations) {
    if receiver.is_some_and(|receiver| receiver.both_hands) {
        v.field("receiver")
            .child("both_hands")
            .add("is true; only FindGrasp takes an object with both hands: leave it out");
    }
}

/// Which grasps are sent.
fn sent(sent: Option<request::Sent>, v: &Violations) -> Sent {
    let rate = match sent {
        Some(request::Sent::Alternatives(sent)) => return alternatives(&sent, v),
        Some(request::Sent::MaxRateHz(rate)) => rate,
        None => DEFAULT_RATE,
    };
    check_positive(v.field("max_rate_hz"), rate, MAX_RATE);
    let interval = Duration::try_from_secs_f32(1.0 / rate).unwrap_or(MAX_INTERVAL);
    Sent::Better {
        interval: interval.min(MAX_INTERVAL),
    }
}

/// The best ones that differ.
fn alternatives(v1::Alternatives { count, differ_by }: &v1::Alternatives, v: &Violations) -> Sent {
    let parent = v.field("alternatives");
    check_within(parent.child("count"), *count, 1..=MAX_ALTERNATIVES);
    let mut by = Differences {
        approach: differ_by.is_empty(),
        grasp_type: false,
        region: false,
    };
    let listed = parent.child("differ_by");
    for (place, &value) in differ_by.iter().enumerate() {
        match known(listed.at(place), value) {
            v1::DifferBy::Unspecified | v1::DifferBy::Approach => by.approach = true,
            v1::DifferBy::Type => by.grasp_type = true,
            v1::DifferBy::Region => by.region = true,
        }
    }
    Sent::Alternatives {
        count: *count as usize,
        by,
    }
}
