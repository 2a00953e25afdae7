//! `[[known_grips]]`: grips that are known of the object, as in the files that `grasp objects create` reads.

use grasp_proto::v1;
use toml::Value;

use super::values::{list, listed, number, one_of, optional, pose, required, table_of, text};
use crate::validate::{Field, Violations};

/// The keys of a grip.
const KEYS: [&str; 10] = [
    "name",
    "use",
    "rig",
    "handedness",
    "hand_scale",
    "object_from_wrist",
    "digits",
    "near_metres",
    "near_radians",
    "convention",
];

/// The keys of a digit.
const DIGIT_KEYS: [&str; 4] = ["base_yaw", "base_pitch", "second_pitch", "third_pitch"];

/// What becomes of a grip.
const USES: [(&str, v1::KnownGripUse); 2] = [
    ("preferred", v1::KnownGripUse::Preferred),
    ("banned", v1::KnownGripUse::Banned),
];

/// The hands.
const HANDS: [(&str, v1::Handedness); 2] = [("left", v1::Handedness::Left), ("right", v1::Handedness::Right)];

/// What a wrist may be given in.
const CONVENTIONS: [(&str, v1::Convention); 4] = [
    ("openxr", v1::Convention::Openxr),
    ("unity", v1::Convention::Unity),
    ("unreal", v1::Convention::Unreal),
    ("godot", v1::Convention::Godot),
];

/// A grip, unchecked but for its types.
pub(super) fn known_grip(
    field: Field<'_>,
    value: &Value,
    violations: &mut Violations,
) -> Option<v1::KnownGrip> {
    let before = violations.len();
    let table = table_of(field, value, &KEYS, violations)?;
    let at = |key: &'static str| (field.child(key), table.get(key));
    let (place, name) = at("name");
    let name = required(place, name, "a text", violations)
        .and_then(|value| text(place, value, "a text", violations));
    let (place, given) = at("use");
    let used = required(place, given, &listed(&USES), violations)
        .and_then(|value| one_of(place, value, &USES, violations));
    let (place, given) = at("handedness");
    let handedness = required(place, given, &listed(&HANDS), violations)
        .and_then(|value| one_of(place, value, &HANDS, violations));
    let rig = optional(at("rig"), violations, |place, value, violations| {
        text(place, value, "the name of a rig", violations)
    });
    let hand_scale = optional(at("hand_scale"), violations, number);
    let object_from_wrist = optional(at("object_from_wrist"), violations, pose);
    let digits = list(field.child("digits"), table.get("digits"), violations, digit);
    let near_metres = optional(at("near_metres"), violations, number);
    let near_radians = optional(at("near_radians"), violations, number);
    let convention = optional(at("convention"), violations, |place, value, violations| {
        one_of(place, value, &CONVENTIONS, violations)
    });
    (violations.len() == before).then_some(v1::KnownGrip {
        name: name?,
        r#use: used?.into(),
        rig: rig.unwrap_or_default(),
        handedness: handedness?.into(),
        hand_scale,
        object_from_wrist,
        digits,
        near_metres,
        near_radians,
        convention: convention.unwrap_or_default().into(),
    })
}

/// The angles of a digit; 0 if absent.
fn digit(field: Field<'_>, value: &Value, violations: &mut Violations) -> Option<v1::DigitAngles> {
    let before = violations.len();
    let table = table_of(field, value, &DIGIT_KEYS, violations)?;
    let [base_yaw, base_pitch, second_pitch, third_pitch] =
        DIGIT_KEYS.map(|key| optional((field.child(key), table.get(key)), violations, number));
    (violations.len() == before).then_some(v1::DigitAngles {
        base_yaw: base_yaw.unwrap_or_default(),
        base_pitch: base_pitch.unwrap_or_default(),
        second_pitch: second_pitch.unwrap_or_default(),
        third_pitch,
    })
}
