//! Checks the grips that a client knows of its object.

use grasp_assets::hands::{RIG_NAMES, hand};
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::{
        hand::{DigitAngles, HandPose, Handedness, rig::Rig},
        plain_object::BannedGrip,
    },
};

use super::{
    Field, Violations, check_count, check_positive,
    hand::{AngleBounds, checked_digits, convention_of, hand_scale, wrist_at_object},
    names::GivenNames,
    quoted, required, required_handedness,
    rig::rig_id_of,
};
use crate::{
    convention::Convention,
    rigs::{COLLECTION, name_of},
};

/// Largest number of grips of an object. Each preferred one takes some tens of microseconds of every search.
const MAX_GRIPS: usize = 32;

/// Bounds and defaults of what is near a forbidden grip: in metres, and in radians.
const NEAR: [(&str, f32, f32); 2] = [("near_distance", 1.0, 0.03), ("near_angle", 3.2, 0.5)];

/// A checked grip, as a client gave it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GripFields {
    /// The message.
    pub given: v1::KnownGrip,
    /// What becomes of it; `None` if it is wrong.
    pub kind: Option<GripKind>,
}

/// What becomes of a grip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum GripKind {
    /// It is tried first.
    Preferred(PreferredGrip),
    /// Nothing near it is answered.
    Banned(BannedGrip),
}

/// A grip to try first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PreferredGrip {
    pub handedness: Handedness,
    /// Its size, in hundredths of its rig's.
    pub hundredths: u16,
    /// Its wrist in the object's frame.
    pub object_from_wrist: Pose,
    /// Its joint angles, thumb first. Those of a created rig may be beyond its limits.
    pub digits: [DigitAngles; 5],
}

impl PreferredGrip {
    /// The hand in the object's frame, within the limits of its rig.
    pub(crate) fn pose(&self, rig: &Rig) -> HandPose {
        HandPose {
            frame_from_wrist: self.object_from_wrist,
            digits: std::array::from_fn(|place| rig.digits[place].limits.clamped(self.digits[place])),
        }
    }
}

impl GripFields {
    /// The name of the hand's rig.
    pub(crate) fn rig(&self) -> &str {
        self.given.hand.as_ref().map_or("", |hand| &hand.rig)
    }

    /// The wrist in the object's frame, if its numbers are in this convention.
    pub(crate) fn wrist_in(&self, convention: Convention) -> Pose {
        let sent = self.given.hand.as_ref().and_then(|hand| hand.object_from_wrist);
        // What is wrong with it was said before.
        let unsaid = Violations::default();
        let field = unsaid.field("object_from_wrist");
        wrist_at_object(field, sent.unwrap_or_default(), convention)
    }
}

/// The grips, in their places.
pub(super) fn known_grips(field: Field<'_>, given: Vec<v1::KnownGrip>) -> Vec<GripFields> {
    if !check_count(field, given.len(), MAX_GRIPS, "grips") {
        return Vec::new();
    }
    let mut names = GivenNames::of("grip");
    let mut checked = Vec::with_capacity(given.len());
    for (place, given) in given.into_iter().enumerate() {
        let field = field.at(place);
        names.check(field.child("name"), &given.name);
        checked.push(GripFields {
            kind: kind(field, &given),
            given: kept(given),
        });
    }
    checked
}

/// What is kept of a grip: only what counts of its hand, in a convention that is named.
fn kept(given: v1::KnownGrip) -> v1::KnownGrip {
    let hand = given.hand.map(|hand| {
        let convention = match hand.convention() {
            v1::Convention::Unspecified => v1::Convention::Openxr,
            named => named,
        };
        v1::HandPose {
            client_from_wrist: None,
            convention: convention.into(),
            joints: Vec::new(),
            model: Vec::new(),
            ..hand
        }
    });
    v1::KnownGrip { hand, ..given }
}

fn kind(field: Field<'_>, given: &v1::KnownGrip) -> Option<GripKind> {
    let preference = v1::Preference::try_from(given.preference).unwrap_or_default();
    if !matches!(preference, v1::Preference::Preferred | v1::Preference::Forbidden) {
        field.child("preference").add(format_args!(
            "is {}; it must be PREFERENCE_PREFERRED or PREFERENCE_FORBIDDEN",
            given.preference
        ));
    }
    let hand_field = field.child("hand");
    let hand = required(hand_field, given.hand.as_ref())?;
    let handedness = required_handedness(hand_field.child("handedness"), hand.handedness);
    let convention = convention_of(hand_field, hand, Convention::OpenXr);
    let wrist_field = hand_field.child("object_from_wrist");
    let object_from_wrist = required(wrist_field, hand.object_from_wrist)
        .map(|wrist| wrist_at_object(wrist_field, wrist, convention));
    if preference == v1::Preference::Forbidden {
        let near = |(name, most, default), value: Option<f32>| {
            let value = value.unwrap_or(default);
            check_positive(field.child(name), value, most);
            value
        };
        let distance = near(NEAR[0], given.near_distance);
        let angle = near(NEAR[1], given.near_angle);
        return Some(GripKind::Banned(BannedGrip {
            handedness: handedness?,
            object_from_wrist: object_from_wrist?,
            distance,
            angle,
        }));
    }
    let rig = built_in_rig(hand_field.child("rig"), &hand.rig);
    let scale = hand_scale(hand_field.child("scale"), hand.scale);
    let digits = checked_digits(hand_field, hand, rig, AngleBounds::Rig);
    for (name, value) in [(NEAR[0].0, given.near_distance), (NEAR[1].0, given.near_angle)] {
        if let Some(value) = value
            && preference == v1::Preference::Preferred
        {
            field.child(name).add(format_args!(
                "is {value}; leave it out, because only forbidden grips have neighbours"
            ));
        }
    }
    (preference == v1::Preference::Preferred).then_some(())?;
    Some(GripKind::Preferred(PreferredGrip {
        handedness: handedness?,
        hundredths: (100.0 * scale).round() as u16,
        object_from_wrist: object_from_wrist?,
        digits,
    }))
}

/// The hand of a built-in rig; `None` for a created one, which may be gone by the time that the object is used.
fn built_in_rig(field: Field<'_>, name: &str) -> Option<&'static Rig> {
    let id = name.strip_prefix(COLLECTION);
    if let Some(hand) = id.and_then(|id| hand(id, Handedness::Right)) {
        return Some(&hand.rig);
    }
    if id.is_some() {
        rig_id_of(field, name);
    } else {
        field.add(format_args!(
            "is {}; it must be {} or the name of a created rig, {COLLECTION} and its id",
            quoted(name),
            RIG_NAMES.map(name_of).join(", ")
        ));
    }
    None
}
