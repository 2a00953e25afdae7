//! The holdout of a checked request, in the object's frame.

use std::sync::Arc;

use grasp_synthesis::model::{
    holdout::{Holdout, PresentingHand},
    object::GraspObject,
    receiver::Stance,
    strategy::Validity,
};

use crate::{error::ServiceError, validate::FindQuery};

/// Poses the giver's hand and places everything else around the object. The receiver's arm is that of one hand, from a
/// `stance` in the client's frame.
///
/// # Errors
/// The giver's joints fold its skin.
pub(super) fn holdout(
    query: &FindQuery,
    object: &Arc<GraspObject>,
    stance: Stance,
) -> Result<Holdout, ServiceError> {
    let object_from_client = query.client_from_object.inverse();
    let presenting_hand = match &query.presenting_hand {
        None => None,
        Some(giver) if query.validity == Validity::Physical => Some(PresentingHand::of_joints(
            giver.joints.transformed(object_from_client),
        )),
        Some(giver) => Some(
            PresentingHand::in_frame(&giver.skin, &giver.joints, object_from_client)
                .map_err(|error| ServiceError::invalid(giver.field, error.to_string()))?,
        ),
    };
    let hands = query.other_hands.iter();
    let obstacles = query.obstacles.iter();
    Ok(Holdout {
        object: Arc::clone(object),
        presenting_hand,
        other_hands: hands
            .map(|hand| hand.joints.transformed(object_from_client))
            .collect(),
        obstacles: obstacles
            .map(|obstacle| obstacle.transformed(object_from_client))
            .collect(),
        stance: stance.transformed(object_from_client),
        up: object_from_client.transform_vector(query.up),
    })
}
