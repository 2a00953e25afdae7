//! Checks `Receiver`.

mod body;
mod hands;

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::model::strategy::Validity;

use super::Field;
use crate::{convention::Convention, rigs::store::RigStore};
pub(crate) use body::Stances;
use body::{Surroundings, stances};
pub(super) use hands::ReceivingHands;
use hands::receiving_hands;

/// Who takes the object.
#[derive(Debug)]
pub(super) struct Receiver {
    /// None if they are wrong.
    pub hands: Option<ReceivingHands>,
    /// True if either hand may be posed.
    pub chooses_hand: bool,
    pub takes_both_hands: bool,
    pub stances: Stances,
}

/// The receiver of an object whose origin is at `object` in the client's frame and `OpenXR` axes; none if that is wrong.
pub(super) fn receiver(
    field: Field<'_>,
    sent: Option<v1::Receiver>,
    (convention, object, validity): (Convention, Option<Vec3>, Validity),
    rigs: (&str, &RigStore),
) -> Receiver {
    let sent = sent.unwrap_or_default();
    let hands = receiving_hands(field, &sent, validity, rigs);
    let is_named = sent.handedness != i32::from(v1::Handedness::Unspecified);
    let takes_both_hands = sent.both_hands;
    let chooses_hand = !is_named && !takes_both_hands && validity == Validity::Physical;
    let surroundings = Surroundings {
        convention,
        object,
        validity,
        takes_both_hands,
        chooses_hand,
    };
    Receiver {
        hands,
        chooses_hand,
        takes_both_hands,
        stances: stances(field, &sent, &surroundings),
    }
}
