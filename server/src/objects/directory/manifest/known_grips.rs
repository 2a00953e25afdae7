//! `[[known_grips]]`: grips that are known of the object.

use grasp_proto::v1;
use toml::Value;

use super::values::{listed, number, one_of, optional, pose, required, table_of, text};
use crate::validate::{Field, Violations};

/// The keys of a grip.
const KEYS: [&str; 5] = ["name", "preference", "hand", "near_distance", "near_angle"];

/// The keys of a hand.
const HAND_KEYS: [&str; 10] = [
    "rig",
    "handedness",
    "scale",
    "object_from_wrist",
    "thumb",
    "index",
    "middle",
    "ring",
    "little",
    "convention",
];

/// Those of them that are digits.
const DIGITS: [&str; 5] = ["thumb", "index", "middle", "ring", "little"];

/// The keys of a digit.
const DIGIT_KEYS: [&str; 4] = ["base_yaw", "base_pitch", "second_pitch", "third_pitch"];

/// What becomes of a grip.
const PREFERENCES: [(&str, v1::Preference); 2] = [
    ("preferred", v1::Preference::Preferred),
    ("forbidden", v1::Preference::Forbidden),
];

/// The hands.
const HANDS: [(&str, v1::Handedness); 2] = [("left", v1::Handedness::Left), ("right", v1::Handedness::Right)];

/// What a wrist may be given in.
const CONVENTIONS: [(&str, v1::Convention); 6] = [
    ("openxr", v1::Convention::Openxr),
    ("unity", v1::Convention::Unity),
    ("unreal", v1::Convention::Unreal),
    ("godot", v1::Convention::Godot),
    ("unity_flip_x", v1::Convention::UnityFlipX),
    ("unreal_xzy", v1::Convention::UnrealXzy),
];

/// A grip, unchecked but for its types.
pub(super) fn known_grip(field: Field<'_>, value: &Value, violations: &Violations) -> Option<v1::KnownGrip> {
    let before = violations.len();
    let table = table_of(field, value, &KEYS, violations)?;
    let at = |key: &'static str| (field.child(key), table.get(key));
    let (place, name) = at("name");
    let name = required(place, name, "a text", violations)
        .and_then(|value| text(place, value, "a text", violations));
    let (place, given) = at("preference");
    let preference = required(place, given, &listed(&PREFERENCES), violations)
        .and_then(|value| one_of(place, value, &PREFERENCES, violations));
    let (place, given) = at("hand");
    let posed = required(place, given, "a table with a hand", violations)
        .and_then(|value| hand(place, value, violations));
    let near_distance = optional(at("near_distance"), violations, number);
    let near_angle = optional(at("near_angle"), violations, number);
    (violations.len() == before).then_some(v1::KnownGrip {
        near_distance,
        near_angle,
        ..v1::KnownGrip::new(name?, preference?, posed?)
    })
}

/// A hand at the object.
fn hand(field: Field<'_>, value: &Value, violations: &Violations) -> Option<v1::HandPose> {
    let before = violations.len();
    let table = table_of(field, value, &HAND_KEYS, violations)?;
    let at = |key: &'static str| (field.child(key), table.get(key));
    let rig = optional(at("rig"), violations, |place, value, violations| {
        text(place, value, "the name of a rig", violations)
    });
    let (place, given) = at("handedness");
    let handedness = required(place, given, &listed(&HANDS), violations)
        .and_then(|value| one_of(place, value, &HANDS, violations));
    let scale = optional(at("scale"), violations, number);
    let object_from_wrist = optional(at("object_from_wrist"), violations, pose);
    let digits = DIGITS.map(|key| optional(at(key), violations, digit));
    let convention = optional(at("convention"), violations, |place, value, violations| {
        one_of(place, value, &CONVENTIONS, violations)
    });
    let hand = v1::HandPose {
        scale,
        object_from_wrist,
        convention: convention.unwrap_or_default().into(),
        ..v1::HandPose::new(rig.unwrap_or_default(), handedness.unwrap_or_default())
    };
    (violations.len() == before).then_some(hand.with_digits(digits))
}

/// The angles of a digit; 0 if absent.
fn digit(field: Field<'_>, value: &Value, violations: &Violations) -> Option<v1::DigitAngles> {
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
