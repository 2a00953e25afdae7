//! Checks `Receiver`.

mod body;

use std::borrow::Cow;

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::model::{
    hand::{Digit, Handedness},
    strategy::Validity,
};

use super::{
    Field,
    hand::{hand_scale, rig_named},
    handedness,
};
use crate::{
    convention::Convention,
    rigs::{COLLECTION, RigHand, name_of, store::RigStore},
};
pub(crate) use body::Stances;
use body::{Surroundings, stances};

/// The receiving hand's rig under THESIS validity: that of chapter 5.
const THESIS_RIG: &str = "rigs/thesis";

/// A receiver's hands of one rig.
#[derive(Clone, Debug)]
pub(super) struct ReceivingHands {
    /// The hand to pose.
    pub hand: RigHand,
    /// The same person's other hand.
    pub other: RigHand,
}

/// Who takes the object.
#[derive(Debug)]
pub(super) struct Receiver {
    /// `None` if they are wrong.
    pub hands: Option<ReceivingHands>,
    /// True if either hand may be posed.
    pub chooses_hand: bool,
    pub takes_both_hands: bool,
    pub stances: Stances,
}

/// The receiver of an object whose origin is at `object` in the client's frame and `OpenXR` axes; `None` if that is wrong.
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

/// The receiving hands, by default of the default rig or, under THESIS validity, of chapter 5's; the right one first unless the
/// request names the left one.
fn receiving_hands(
    field: Field<'_>,
    sent: &v1::Receiver,
    validity: Validity,
    (default_rig, rigs): (&str, &RigStore),
) -> Option<ReceivingHands> {
    let handedness = handedness(field.child("handedness"), sent.handedness).unwrap_or(Handedness::Right);
    let name = match (sent.rig.as_str(), validity) {
        ("", Validity::Thesis) => Cow::Borrowed(THESIS_RIG),
        ("", Validity::Physical) if default_rig.starts_with(COLLECTION) => Cow::Borrowed(default_rig),
        ("", Validity::Physical) => Cow::Owned(name_of(default_rig)),
        (named, _) => Cow::Borrowed(named),
    };
    let scale = hand_scale(field.child("scale"), sent.scale);
    let hundredths = (100.0 * scale).round() as u16;
    let rig_field = field.child("rig");
    let rig = rig_named(rig_field, &name, rigs)?;
    let lacks = |digit: Digit| !rig.hand(handedness).hand.rig.has(digit);
    if validity == Validity::Thesis && Digit::ALL.into_iter().any(lacks) {
        rig_field.add(
            "has fewer than five digits, which thesis_validity poses; leave that out or use another rig",
        );
    }
    let sized = |side| match hundredths {
        100 => rig.hand(side).clone(),
        _ => rigs.scaled(rig.hand(side), hundredths),
    };
    Some(ReceivingHands {
        hand: sized(handedness),
        other: sized(handedness.other()),
    })
}
