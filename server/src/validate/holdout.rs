//! Checks `Holdout`.

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::{base::pose::Pose, model::strategy::Validity};

use super::{
    Field, GiverHand, check_within,
    frames::{Frames, object_pose},
    hand,
    object::{check_mass, object_id_of},
    obstacles::{Obstacles, obstacles, other_hands},
};
use crate::{convention::Convention, rigs::store::RigStore};

/// Allowed sizes of an object relative to its mesh.
const OBJECT_SCALES: std::ops::RangeInclusive<f32> = 0.25..=4.0;

/// What a request says about the size of its object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RequestedSize {
    /// Hundredths of the size of its mesh.
    pub hundredths: u16,
    /// Mass in kilograms; `None` for that of the same material.
    pub mass: Option<f32>,
}

/// An object, its pose, and what is near it, in the client's frame and `OpenXR` axes.
#[derive(Debug)]
pub(super) struct Holdout {
    /// `None` if it is wrong.
    pub object_id: Option<String>,
    pub object_size: RequestedSize,
    pub client_from_object: Pose,
    /// Origin of the object; `None` if its pose is wrong.
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

/// The size of the object; that of its mesh if it is wrong.
fn object_size(holdout: Field<'_>, scale: Option<f32>, mass: Option<f32>) -> RequestedSize {
    let scale = scale.unwrap_or(1.0);
    check_within(holdout.child("scale"), scale, OBJECT_SCALES);
    if let Some(mass) = mass {
        check_mass(holdout.child("mass_kg"), mass);
    }
    RequestedSize {
        // Saturates for what is wrong.
        hundredths: (100.0 * scale).round() as u16,
        mass,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::testing::read_at;

    fn size(scale: Option<f32>, mass: Option<f32>) -> (RequestedSize, Vec<String>) {
        read_at("holdout", |field| object_size(field, scale, mass))
    }

    #[test]
    fn scales_are_rounded_to_hundredths() {
        for (scale, hundredths) in [
            (None, 100),
            (Some(0.25), 25),
            (Some(1.004), 100),
            (Some(1.006), 101),
            (Some(4.0), 400),
        ] {
            let expected = RequestedSize {
                hundredths,
                mass: None,
            };
            assert_eq!(size(scale, None), (expected, Vec::new()));
        }
    }
}
