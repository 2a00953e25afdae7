//! Checks `Holdout`.

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::{base::pose::Pose, model::strategy::Validity};

use super::{
    Field, GiverHand,
    frames::{Frames, object_pose},
    hand, object_id_of,
    object_size::{RequestedSize, object_size},
    obstacles::{Obstacles, obstacles, other_hands},
};
use crate::{convention::Convention, rigs::store::RigStore};

/// An object, its pose, and what is near it, in the client's frame and `OpenXR` axes.
#[derive(Debug)]
pub(super) struct Holdout {
    /// None if it is wrong.
    pub object_id: Option<String>,
    pub object_size: RequestedSize,
    pub client_from_object: Pose,
    /// Origin of the object; none if its pose is wrong.
    pub origin: Option<Vec3>,
    pub presenting_hand: Option<GiverHand>,
    pub other_hands: Vec<GiverHand>,
    pub obstacles: Obstacles,
    /// A unit vector.
    pub up: Vec3,
}

pub(super) fn holdout(
    field: Field<'_>,
    sent: v1::Holdout,
    validity: Validity,
    (convention, rigs): (Convention, &RigStore),
) -> Holdout {
    let object_id = object_id_of(field.child("object"), &sent.object);
    let object_size = object_size(field, sent.scale, sent.mass_kg);
    let object_field = field.child("client_from_object");
    let (client_from_object, origin) = object_pose(object_field, sent.client_from_object, convention);
    let frames = Frames {
        convention,
        client_from_object,
        rigs,
    };
    let presenting_field = field.child("presenting_hand");
    let presenting_hand = sent
        .presenting_hand
        .and_then(|sent| hand::presenting_hand(presenting_field, sent, &frames));
    Holdout {
        object_id,
        object_size,
        client_from_object,
        origin,
        other_hands: other_hands(
            field.child("other_hands"),
            (presenting_hand.as_ref(), sent.other_hands),
            validity,
            &frames,
        ),
        presenting_hand,
        obstacles: obstacles(field.child("obstacles"), &sent.obstacles, validity, &frames),
        up: hand::up(field.child("up"), sent.up, convention),
    }
}
