//! Checks `EvaluateHoldoutRequest`.

use grasp_proto::v1;

use super::{
    FindQuery, GiverHand, Violations, check_count, check_unset,
    find_grasp::{checked_query, finished},
    frames::Frames,
    hand::{check_meshes_together, presenting_hands},
    requirements::check_no_experiment,
    stream_grasps::check_one_hand,
};
use crate::{error::ServiceError, rigs::store::RigStore};

/// Largest number of further poses of the giver's hand. Each takes a millisecond or two with an atlas.
const MAX_PRESENTING_HANDS: usize = 64;

/// A valid request.
#[derive(Debug)]
pub(crate) struct EvaluateQuery {
    pub holdout: FindQuery,
    /// Further hands in place of the giver's, in the client's frame and `OpenXR` axes.
    pub other_presenting_hands: Vec<GiverHand>,
}

/// Checks a request, as [`super::find_query`] does for its object.
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
    let violations = Violations::default();
    let v = &violations;
    let others_field = v.field("other_presenting_hands");
    let frames = Frames::of(holdout.as_ref(), output, rigs);
    check_count(
        others_field,
        other_presenting_hands.len(),
        MAX_PRESENTING_HANDS,
        "elements",
    );
    let others = presenting_hands(
        others_field,
        other_presenting_hands,
        MAX_PRESENTING_HANDS,
        &frames,
    );
    check_one_hand(receiver.as_ref(), v);
    check_no_experiment(requirements.as_ref(), v);
    check_absent(search, output, v);
    let parts = v1::FindGraspRequest {
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
    let holdout = checked_query(parts, (default_rig, rigs), object_exists, v);
    if let Some(holdout) = &holdout {
        let hands = holdout.presenting_hand.iter().chain(&holdout.other_hands);
        check_meshes_together(others_field, hands.chain(&others));
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

/// Adds a violation for each field that has no meaning without a search for a single answer.
fn check_absent(search: Option<v1::SearchOptions>, output: Option<v1::OutputOptions>, v: &Violations) {
    let is_replay = search.is_some_and(|search| search.replay_attempt.is_some());
    let has_key_frames = output.is_some_and(|output| output.key_frames);
    let why_not = "an evaluation answers no single grasp: leave it out";
    check_unset(v.field("search"), [("replay_attempt", is_replay)], why_not);
    check_unset(v.field("output"), [("key_frames", has_key_frames)], why_not);
}
