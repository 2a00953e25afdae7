//! Checks `ValidateGraspRequest`.

use grasp_proto::v1;

use super::{
    Field, FindQuery, Violations,
    find_grasp::{checked_query, finished},
    hand::{Given, GivenGrasp, given_grasp},
    quoted,
};
use crate::{convention::Convention, error::ServiceError, rigs::store::RigStore};

/// A valid request.
#[derive(Debug)]
pub(crate) struct ValidateQuery {
    /// The holdout, as for a search for the first valid grasp.
    pub holdout: FindQuery,
    /// The grasp.
    pub grasp: GivenGrasp,
    /// True to search for a valid grasp near it.
    pub find_nearest: bool,
    /// What was repaired in the grasp.
    pub warnings: Vec<String>,
}

/// Checks a request, as [`super::find_query`] does for its object.
///
/// # Errors
/// [`ServiceError::Invalid`] with every violation.
pub(crate) fn validate_query(
    request: v1::ValidateGraspRequest,
    (default_rig, rigs): (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<ValidateQuery, ServiceError> {
    let v1::ValidateGraspRequest {
        holdout,
        grasp,
        find_nearest,
    } = request;
    let mut violations = Violations::default();
    let field = Field::root("holdout");
    let sent = holdout.as_ref().map(|holdout| holdout.convention);
    let convention = sent.and_then(|sent| v1::Convention::try_from(sent).ok());
    let mut of_grasp = Violations::default();
    let given = given_grasp(
        Field::root("grasp"),
        grasp,
        Convention::from_wire(convention.unwrap_or_default()),
        rigs,
        &mut of_grasp,
    );
    violations.add_all_beside_holdout(of_grasp);
    let Some(mut holdout) = holdout else {
        violations.add(field, "is absent; it is required");
        return Err(violations.into_error());
    };
    let mut of_holdout = Violations::default();
    check_one_physical_hand(&holdout, &mut of_holdout);
    holdout.receiving_hand = Some(receiving_hand(
        holdout.receiving_hand.take(),
        &given,
        &mut of_holdout,
    ));
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
    let Given { grasp, warnings, .. } = given;
    let query = holdout.zip(grasp).map(|(holdout, grasp)| ValidateQuery {
        holdout,
        grasp,
        find_nearest,
        warnings,
    });
    finished(query, violations)
}

/// Adds a violation for each demand on the validity and the number of hands that only searches meet.
pub(super) fn check_one_physical_hand(holdout: &v1::FindGraspRequest, violations: &mut Violations) {
    if v1::Validity::try_from(holdout.validity) == Ok(v1::Validity::Thesis) {
        violations.add(
            Field::root("validity"),
            "is VALIDITY_THESIS, whose checks have no figures; use VALIDITY_PHYSICAL or leave it out",
        );
    }
    if v1::Hands::try_from(holdout.hands) == Ok(v1::Hands::Both) {
        violations.add(
            Field::root("hands"),
            "is HANDS_BOTH; only one hand can be checked: use HANDS_ONE or leave it out",
        );
    }
}

/// Leaves out what only says how to search, but not whether to use the atlas. Values that the contract does not define stay, to be found wrong.
pub(super) fn ignore_search(holdout: &mut v1::FindGraspRequest) {
    if v1::Choice::try_from(holdout.choice).is_ok() {
        holdout.choice = v1::Choice::Unspecified.into();
    }
    if v1::Strategy::try_from(holdout.strategy).is_ok() {
        holdout.strategy = v1::Strategy::Unspecified.into();
    }
    holdout.max_attempts = None;
    holdout.only_attempt = None;
    holdout.reproducible = false;
    holdout.plan_key_frames = false;
    holdout.standing = None;
}

/// The hand that the grasp is of. What the request says about the receiving hand must not contradict it.
fn receiving_hand(
    sent: Option<v1::ReceivingHand>,
    given: &Given,
    violations: &mut Violations,
) -> v1::ReceivingHand {
    let field = Field::root("receiving_hand");
    let sent = sent.unwrap_or_default();
    let v1::ReceivingHand {
        rig,
        handedness,
        hand_scale,
    } = given.hand.clone();
    if given.grasp.is_none() {
        return sent;
    }
    let unspecified = i32::from(v1::Handedness::Unspecified);
    let names = |side: i32| v1::Handedness::try_from(side).map(|side| side.as_str_name());
    if let (true, Ok(named), Ok(given)) = (
        sent.handedness != unspecified && sent.handedness != handedness,
        names(sent.handedness),
        names(handedness),
    ) {
        violations.add(
            field.child("handedness"),
            format_args!("is {named}, but the grasp is of {given}; leave it out"),
        );
    }
    // Tracked joints have no rig of their own.
    if rig.is_empty() {
        return v1::ReceivingHand {
            // A value that the contract does not define stays, to be found wrong.
            handedness: if names(sent.handedness).is_ok() {
                handedness
            } else {
                sent.handedness
            },
            ..sent
        };
    }
    if !sent.rig.is_empty() && sent.rig != rig {
        violations.add(
            field.child("rig"),
            format_args!(
                "is {}, but the grasp is of {}; leave it out",
                quoted(&sent.rig),
                quoted(&rig)
            ),
        );
    }
    let scale = hand_scale.unwrap_or(1.0);
    if let Some(sent) = sent.hand_scale
        && (sent.is_nan() || (sent - scale).abs() >= 0.005)
    {
        violations.add(
            field.child("hand_scale"),
            format_args!(
                "is {sent}, but the hand of the grasp is {scale} times as large as its rig; leave it out"
            ),
        );
    }
    v1::ReceivingHand {
        rig,
        handedness: if names(sent.handedness).is_ok() {
            handedness
        } else {
            sent.handedness
        },
        hand_scale,
    }
}
