//! Checks `EvaluateHoldoutRequest`.

use grasp_proto::v1;

use super::{
    Field, FindQuery, GiverHand, Violations,
    find_grasp::{Parts, checked_query, finished},
    frames::Frames,
    hand::{check_meshes_together, presenting_hand},
    requirements::check_no_experiment,
    stream_grasps::check_one_hand,
};
use crate::{error::ServiceError, rigs::store::RigStore};

/// Largest number of further poses of the giver's hand. Each takes a millisecond or two with an atlas.
const MOST_PRESENTING_HANDS: usize = 64;

/// A valid request.
#[derive(Debug)]
pub(crate) struct EvaluateQuery {
    /// The holdout.
    pub holdout: FindQuery,
    /// Further hands in place of the giver's, in the client's frame and `OpenXR` axes.
    pub other_presenting_hands: Vec<GiverHand>,
}

/// Checks a request, as [`super::find_query`] does for its object.
///
/// # Errors
/// [`ServiceError::Invalid`] with every violation.
pub(crate) fn evaluate_query(
    request: v1::EvaluateHoldoutRequest,
    (default_rig, rigs): (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<EvaluateQuery, ServiceError> {
    let v1::EvaluateHoldoutRequest {
        holdout,
        receiver,
        requirements,
        search,
        output,
        other_presenting_hands,
    } = request;
    let mut violations = Violations::default();
    let v = &mut violations;
    let others_field = Field::root("other_presenting_hands");
    let frames = Frames::of(holdout.as_ref(), output);
    let others = other_hands(others_field, other_presenting_hands, &frames, rigs, v);
    check_one_hand(receiver.as_ref(), v);
    check_no_experiment(requirements.as_ref(), v);
    check_absent(search, output, v);
    let parts = Parts {
        holdout,
        receiver,
        requirements,
        search: search.map(without_effect),
        output: output.map(|output| v1::OutputOptions {
            key_frames: false,
            ..output
        }),
        current: None,
    };
    let holdout = checked_query(parts, (default_rig, rigs), object_exists, !v.is_empty(), v);
    if let Some(holdout) = &holdout {
        let hands = holdout.presenting_hand.iter().chain(&holdout.other_hands);
        check_meshes_together(others_field, hands.chain(&others), v);
    }
    let query = holdout.map(|holdout| EvaluateQuery {
        holdout,
        other_presenting_hands: others,
    });
    finished(query, violations)
}

/// The options without those that have no effect. Values that the contract does not define stay, to be found wrong.
fn without_effect(search: v1::SearchOptions) -> v1::SearchOptions {
    let is_known = v1::GraspChoice::try_from(search.choice).is_ok();
    v1::SearchOptions {
        choice: if is_known { 0 } else { search.choice },
        max_attempts: None,
        replay_attempt: None,
        ..search
    }
}

/// The other hands, without those that are wrong.
fn other_hands(
    field: Field<'_>,
    sent: Vec<v1::PresentingHand>,
    frames: &Frames,
    rigs: &RigStore,
    violations: &mut Violations,
) -> Vec<GiverHand> {
    if sent.len() > MOST_PRESENTING_HANDS {
        violations.add(
            field,
            format_args!(
                "has {} elements; it may have up to {MOST_PRESENTING_HANDS}",
                sent.len()
            ),
        );
    }
    sent.into_iter()
        .take(MOST_PRESENTING_HANDS)
        .enumerate()
        .filter_map(|(place, sent)| presenting_hand(field.at(place), sent, frames, rigs, violations))
        .collect()
}

/// Adds a violation for each field that has no meaning without a search for a single answer.
fn check_absent(search: Option<v1::SearchOptions>, output: Option<v1::OutputOptions>, v: &mut Violations) {
    let is_replay = search.is_some_and(|search| search.replay_attempt.is_some());
    let has_key_frames = output.is_some_and(|output| output.key_frames);
    let present = [
        ("search", "replay_attempt", is_replay),
        ("output", "key_frames", has_key_frames),
    ];
    for (parent, name, _) in present.into_iter().filter(|(.., is_present)| *is_present) {
        v.add(
            Field::root(parent).child(name),
            "is set; an evaluation answers no single grasp: leave it out",
        );
    }
}
