//! Checks `EvaluateHoldoutRequest`.

use grasp_proto::v1;

use super::{
    Field, FindQuery, GiverHand, Violations,
    find_grasp::{checked_query, finished},
    hand::{check_meshes_together, presenting_hand},
    validate_grasp::{check_one_physical_hand, ignore_search},
};
use crate::{convention::Convention, error::ServiceError, rigs::store::RigStore};

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
        other_presenting_hands,
    } = request;
    let mut violations = Violations::default();
    let sent = holdout.as_ref().map(|holdout| holdout.convention);
    let convention = sent.and_then(|sent| v1::Convention::try_from(sent).ok());
    let mut of_others = Violations::default();
    let others = other_hands(
        Field::root("other_presenting_hands"),
        other_presenting_hands,
        Convention::from_wire(convention.unwrap_or_default()),
        rigs,
        &mut of_others,
    );
    violations.add_all_beside_holdout(of_others);
    let field = Field::root("holdout");
    let Some(mut holdout) = holdout else {
        violations.add(field, "is absent; it is required");
        return Err(violations.into_error());
    };
    let mut of_holdout = Violations::default();
    check_one_physical_hand(&holdout, &mut of_holdout);
    check_absent(&holdout, &mut of_holdout);
    ignore_search(&mut holdout);
    let others_are_wrong = !violations.is_empty() || !of_holdout.is_empty();
    let holdout = checked_query(
        holdout,
        (default_rig, rigs),
        object_exists,
        others_are_wrong,
        &mut of_holdout,
    );
    violations.add_all_within(field, of_holdout);
    if let Some(holdout) = &holdout {
        let hands = holdout.presenting_hand.iter().chain(&holdout.other_hands);
        check_meshes_together(
            Field::root("other_presenting_hands"),
            hands.chain(&others),
            &mut violations,
        );
    }
    let query = holdout.map(|holdout| EvaluateQuery {
        holdout,
        other_presenting_hands: others,
    });
    finished(query, violations)
}

/// The other hands, without those that are wrong.
fn other_hands(
    field: Field<'_>,
    sent: Vec<v1::PresentingHand>,
    convention: Convention,
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
        .filter_map(|(place, sent)| presenting_hand(field.at(place), sent, convention, rigs, violations))
        .collect()
}

/// Adds a violation for each field that has no meaning without a search for a single answer.
fn check_absent(holdout: &v1::FindGraspRequest, violations: &mut Violations) {
    let present = [
        ("standing", holdout.standing.is_some()),
        ("only_attempt", holdout.only_attempt.is_some()),
        ("plan_key_frames", holdout.plan_key_frames),
    ];
    for (name, _) in present.into_iter().filter(|(_, is_present)| *is_present) {
        violations.add(
            Field::root(name),
            "is present; an evaluation answers no single grasp: leave it out",
        );
    }
}
