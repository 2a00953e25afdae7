//! `NAME.toml`: what a client gives of a `GraspObject`, under the same names.

mod values;

use grasp_proto::v1::{self, shape::Kind};
use toml::{Table, Value};

use self::values::{
    direction, flag, group_name, list, listed, number, one_of, optional, pose, reject, reject_unknown,
    required, table_of, text, triangle_index, vector,
};
use crate::{
    objects::name_of,
    validate::{Field, Labels, Violations},
};

/// The keys of a manifest.
const KEYS: [&str; 9] = [
    "mass_kg",
    "meters_per_unit",
    "z_up",
    "center_of_mass",
    "friction",
    "regions",
    "known_grips",
    "labels",
    "parts",
];

/// The keys of a region.
const REGION_KEYS: [&str; 6] = ["name", "preference", "weight", "groups", "triangles", "shapes"];

/// What hands do with a region.
const REGION_PREFERENCES: [(&str, v1::Preference); 3] = [
    ("preferred", v1::Preference::Preferred),
    ("avoided", v1::Preference::Avoided),
    ("forbidden", v1::Preference::Forbidden),
];

/// What a shape is, with the keys of each.
const SHAPES: [(&str, &[&str]); 3] = [
    ("tube", &["points", "radii"]),
    ("box", &["pose", "half_extents"]),
    ("half_space", &["point", "normal"]),
];

/// The keys of a grip.
const GRIP_KEYS: [&str; 5] = ["name", "preference", "hand", "near_distance", "near_angle"];

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
const GRIP_PREFERENCES: [(&str, v1::Preference); 2] = [
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

/// Mass in kilograms for further checks if none is given; no object gets it.
const PLACEHOLDER_MASS: f32 = 1.0;

/// Reads the manifest of the object with this id key by key, to report everything that is wrong with it. Its values are not checked. None
/// if it is not TOML.
pub(super) fn read_manifest(id: &str, bytes: &[u8], violations: &Violations) -> Option<v1::GraspObject> {
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => {
            violations.add("", format_args!("is not UTF-8: {error}"));
            return None;
        }
    };
    let table: Table = match text.parse() {
        Ok(table) => table,
        Err(error) => {
            let error: toml::de::Error = error;
            let line = error
                .span()
                .map_or(1, |span| 1 + text[..span.start].matches('\n').count());
            violations.add("", format_args!("is not TOML: line {line}: {}", error.message()));
            return None;
        }
    };
    reject_unknown(&table, None, &KEYS, violations);
    if !table.contains_key("mass_kg") {
        violations.add("mass_kg", "is missing; it must be the mass in kilograms");
    }
    let at = |key| (violations.field(key), table.get(key));
    Some(v1::GraspObject {
        name: name_of(id),
        // A missing or wrong mass was added to the violations.
        mass_kg: optional(at("mass_kg"), violations, number).unwrap_or(PLACEHOLDER_MASS),
        meters_per_unit: optional(at("meters_per_unit"), violations, number),
        friction: optional(at("friction"), violations, number),
        z_up: optional(at("z_up"), violations, flag).unwrap_or_default(),
        center_of_mass: optional(at("center_of_mass"), violations, vector),
        regions: list(
            violations.field("regions"),
            table.get("regions"),
            violations,
            region,
        ),
        known_grips: list(
            violations.field("known_grips"),
            table.get("known_grips"),
            violations,
            known_grip,
        ),
        labels: optional(at("labels"), violations, labels).unwrap_or_default(),
        parts: list(
            violations.field("parts"),
            table.get("parts"),
            violations,
            group_name,
        ),
        ..Default::default()
    })
}

/// Labels: a table of texts.
fn labels(field: Field<'_>, value: &Value, violations: &Violations) -> Option<Labels> {
    let Some(table) = value.as_table() else {
        return reject(field, value, "a table of texts", violations);
    };
    let pairs = table.iter().filter_map(|(key, value)| {
        let text = text(field.child(key), value, "a text", violations)?;
        Some((key.clone(), text))
    });
    Some(pairs.collect())
}

/// A region, unchecked but for its types.
fn region(field: Field<'_>, value: &Value, violations: &Violations) -> Option<v1::Region> {
    let before = violations.len();
    let table = table_of(field, value, &REGION_KEYS, violations)?;
    let name = required(field.child("name"), table.get("name"), "a text", violations)
        .and_then(|value| text(field.child("name"), value, "a text", violations));
    let (place, given) = (field.child("preference"), table.get("preference"));
    let preference = required(place, given, &listed(&REGION_PREFERENCES), violations)
        .and_then(|value| one_of(place, value, &REGION_PREFERENCES, violations));
    let weight = optional((field.child("weight"), table.get("weight")), violations, number);
    let groups = list(field.child("groups"), table.get("groups"), violations, group_name);
    let triangles = list(
        field.child("triangles"),
        table.get("triangles"),
        violations,
        triangle_index,
    );
    let shapes = list(field.child("shapes"), table.get("shapes"), violations, shape);
    (violations.len() == before).then_some(v1::Region {
        name: name?,
        preference: preference?.into(),
        weight,
        groups,
        triangles,
        shapes,
    })
}

fn shape(field: Field<'_>, value: &Value, violations: &Violations) -> Option<v1::Shape> {
    let given = value.as_table().filter(|table| table.len() == 1);
    let given = given.and_then(|table| table.iter().next());
    let known = given.and_then(|(key, _)| SHAPES.iter().find(|(name, _)| name == key));
    let (Some((_, inner)), Some((name, keys))) = (given, known) else {
        let needed = format!("a table with one of {}", listed(&SHAPES));
        return reject(field, value, &needed, violations);
    };
    let before = violations.len();
    let field = field.child(name);
    let table = table_of(field, inner, keys, violations)?;
    let at = |key: &'static str| (field.child(key), table.get(key));
    // What is absent, and must not be, is reported with the checks of the request.
    let kind = match *name {
        "box" => Kind::Box(v1::BoxShape {
            pose: optional(at("pose"), violations, pose),
            half_extents: optional(at("half_extents"), violations, vector),
        }),
        "half_space" => Kind::HalfSpace(v1::HalfSpaceShape {
            point: optional(at("point"), violations, vector),
            normal: optional(at("normal"), violations, direction),
        }),
        _ => Kind::Tube(v1::TubeShape {
            points: list(field.child("points"), table.get("points"), violations, vector),
            radii: list(field.child("radii"), table.get("radii"), violations, number),
        }),
    };
    (violations.len() == before).then_some(v1::Shape { kind: Some(kind) })
}

/// A grip, unchecked but for its types.
fn known_grip(field: Field<'_>, value: &Value, violations: &Violations) -> Option<v1::KnownGrip> {
    let before = violations.len();
    let table = table_of(field, value, &GRIP_KEYS, violations)?;
    let at = |key: &'static str| (field.child(key), table.get(key));
    let (place, name) = at("name");
    let name = required(place, name, "a text", violations)
        .and_then(|value| text(place, value, "a text", violations));
    let (place, given) = at("preference");
    let preference = required(place, given, &listed(&GRIP_PREFERENCES), violations)
        .and_then(|value| one_of(place, value, &GRIP_PREFERENCES, violations));
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
