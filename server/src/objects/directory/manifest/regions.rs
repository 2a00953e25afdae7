//! `[[regions]]`: parts of the surface, as in the files that `grasp objects create` reads.

use grasp_proto::v1::{self, shape::Kind};
use toml::Value;

use super::values::{
    direction, group_name, list, listed, number, one_of, optional, pose, reject, required, table_of, text,
    triangle_index, vector,
};
use crate::validate::{Field, Violations};

/// The keys of a region.
const KEYS: [&str; 6] = ["name", "preference", "weight", "groups", "triangles", "shapes"];

/// What hands do with a region.
const PREFERENCES: [(&str, v1::Preference); 3] = [
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

/// A region, unchecked but for its types.
pub(super) fn region(field: Field<'_>, value: &Value, violations: &Violations) -> Option<v1::Region> {
    let before = violations.len();
    let table = table_of(field, value, &KEYS, violations)?;
    let name = required(field.child("name"), table.get("name"), "a text", violations)
        .and_then(|value| text(field.child("name"), value, "a text", violations));
    let (place, given) = (field.child("preference"), table.get("preference"));
    let preference = required(place, given, &listed(&PREFERENCES), violations)
        .and_then(|value| one_of(place, value, &PREFERENCES, violations));
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
