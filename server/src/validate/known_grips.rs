//! Checks the grips that a client knows of its object.

use grasp_assets::hands::{RIG_NAMES, hand};
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::{
        banned_grip::BannedGrip,
        hand::{
            DigitAngles, HandPose, Handedness,
            joints::thesis_from_openxr_frame,
            rig::{AngleRange, DigitLimits, Rig},
        },
    },
};

use super::{
    Field, Violations,
    given_names::GivenNames,
    hand::{checked_digits, hand_scale, required_handedness},
    known, pose, quoted,
    rig::rig_id_of,
};
use crate::{convention::Convention, rigs::COLLECTION};

/// Largest number of grips of an object. Each preferred one takes some tens of microseconds of every search.
const MOST_GRIPS: usize = 32;

/// Bounds and defaults of what is near a banned grip: in metres, and in radians.
const NEAR: [(&str, f32, f32); 2] = [("near_metres", 1.0, 0.03), ("near_radians", 3.2, 0.5)];

/// Limits of joints whose rig is not known: half a turn.
const ANY_ANGLE: AngleRange = AngleRange {
    min: -std::f32::consts::PI,
    max: std::f32::consts::PI,
};

/// A checked grip, as a client gave it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GripFields {
    /// The message.
    pub given: v1::KnownGrip,
    /// What becomes of it; none if it is wrong.
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
    /// The hand.
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
    /// The wrist in the object's frame, if its numbers are in this convention.
    pub(crate) fn wrist_in(&self, convention: Convention) -> Pose {
        wrist_in(
            Field::root("object_from_wrist"),
            &self.given,
            convention,
            &mut Violations::default(),
        )
    }
}

/// The grips, in their places.
pub(super) fn known_grips(
    field: Field<'_>,
    given: Vec<v1::KnownGrip>,
    violations: &mut Violations,
) -> Vec<GripFields> {
    if given.len() > MOST_GRIPS {
        violations.add(
            field,
            format_args!("has {} grips; it may have up to {MOST_GRIPS}", given.len()),
        );
        return Vec::new();
    }
    let mut names = GivenNames::of("grip");
    let mut checked = Vec::with_capacity(given.len());
    for (place, given) in given.into_iter().enumerate() {
        let field = field.at(place);
        names.check(field.child("name"), &given.name, violations);
        checked.push(GripFields {
            kind: kind(field, &given, violations),
            given,
        });
    }
    checked
}

fn kind(field: Field<'_>, given: &v1::KnownGrip, violations: &mut Violations) -> Option<GripKind> {
    let handedness = required_handedness(field.child("handedness"), given.handedness, violations);
    let convention = known(field.child("convention"), given.convention, violations);
    let object_from_wrist = wrist_in(
        field.child("object_from_wrist"),
        given,
        Convention::from_wire(convention),
        violations,
    );
    match v1::KnownGripUse::try_from(given.r#use) {
        Ok(v1::KnownGripUse::Preferred) => {
            let scale = hand_scale(field.child("hand_scale"), given.hand_scale, violations);
            let limits = limits(field.child("rig"), &given.rig, violations);
            let digits = checked_digits(field.child("digits"), &given.digits, &limits, violations);
            for (name, value) in [(NEAR[0].0, given.near_metres), (NEAR[1].0, given.near_radians)] {
                if let Some(value) = value {
                    violations.add(
                        field.child(name),
                        format_args!("is {value}; leave it out, because only banned grips have neighbours"),
                    );
                }
            }
            Some(GripKind::Preferred(PreferredGrip {
                handedness: handedness?,
                hundredths: (100.0 * scale).round() as u16,
                object_from_wrist,
                digits,
            }))
        }
        Ok(v1::KnownGripUse::Banned) => {
            let [distance, angle] = [given.near_metres, given.near_radians];
            let mut near = |(name, most, default): (&str, f32, f32), value: Option<f32>| {
                let value = value.unwrap_or(default);
                if !(value > 0.0 && value <= most) {
                    violations.add(
                        field.child(name),
                        format_args!("is {value}; it must be more than 0 and at most {most}"),
                    );
                }
                value
            };
            let [distance, angle] = [near(NEAR[0], distance), near(NEAR[1], angle)];
            Some(GripKind::Banned(BannedGrip {
                handedness: handedness?,
                object_from_wrist,
                distance,
                angle,
            }))
        }
        Ok(v1::KnownGripUse::Unspecified) | Err(_) => {
            violations.add(
                field.child("use"),
                format_args!(
                    "is {}; it must be KNOWN_GRIP_USE_PREFERRED or KNOWN_GRIP_USE_BANNED",
                    given.r#use
                ),
            );
            None
        }
    }
}

/// The wrist in the object's frame.
fn wrist_in(
    field: Field<'_>,
    given: &v1::KnownGrip,
    convention: Convention,
    violations: &mut Violations,
) -> Pose {
    let wrist = pose(
        field,
        given.object_from_wrist,
        convention.metres_per_unit(),
        violations,
    );
    thesis_from_openxr_frame(convention.joint_to_openxr(wrist))
}

/// The limits of a rig's digits; any angle for a created rig, which may be gone by the time that the object is used.
fn limits(field: Field<'_>, rig: &str, violations: &mut Violations) -> [DigitLimits; 5] {
    if let Some(hand) = hand(rig, Handedness::Right) {
        return hand.rig.digits.map(|digit| digit.limits);
    }
    if rig.starts_with(COLLECTION) {
        rig_id_of(field, rig, violations);
    } else {
        violations.add(
            field,
            format_args!(
                "is {}; it must be {} or the name of a created rig, {COLLECTION} and its id",
                quoted(rig),
                RIG_NAMES.join(", ")
            ),
        );
    }
    [DigitLimits {
        base_yaw: ANY_ANGLE,
        base_pitch: ANY_ANGLE,
        second_pitch: ANY_ANGLE,
        third_pitch: ANY_ANGLE,
    }; 5]
}
