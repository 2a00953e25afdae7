//! `[[regions]]`: parts of the surface, as in the files that `grasp objects create` reads.

use grasp_proto::v1::{self, region_shape::Shape};
use toml::Value;

use super::values::{
    direction, group_name, list, listed, number, one_of, optional, pose, reject, required, table_of, text,
    triangle_index, vector,
};
use crate::validate::{Field, Violations};

/// The keys of a region.
const KEYS: [&str; 6] = ["name", "kind", "weight", "groups", "triangles", "shapes"];

/// What hands do with a region.
const KINDS: [(&str, v1::RegionKind); 3] = [
    ("forbidden", v1::RegionKind::Forbidden),
    ("avoid", v1::RegionKind::Avoid),
    ("prefer", v1::RegionKind::Prefer),
];

/// What a shape is, with the keys of each.
const SHAPES: [(&str, &[&str]); 4] = [
    ("sphere", &["centre", "radius"]),
    ("box", &["object_from_box", "half_extents"]),
    ("half_space", &["point", "normal"]),
    ("tube", &["points", "radius"]),
];

/// A region, unchecked but for its types.
pub(super) fn region(field: Field<'_>, value: &Value, violations: &mut Violations) -> Option<v1::Region> {
    let before = violations.len();
    let table = table_of(field, value, &KEYS, violations)?;
    let name = required(field.child("name"), table.get("name"), "a text", violations)
        .and_then(|value| text(field.child("name"), value, "a text", violations));
    let kind = required(
        field.child("kind"),
        table.get("kind"),
        &listed(&KINDS),
        violations,
    )
    .and_then(|value| one_of(field.child("kind"), value, &KINDS, violations));
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
        kind: kind?.into(),
        weight,
        groups,
        triangles,
        shapes,
    })
}

fn shape(field: Field<'_>, value: &Value, violations: &mut Violations) -> Option<v1::RegionShape> {
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
    let shape = match *name {
        "sphere" => Shape::Sphere(v1::RegionSphere {
            centre: optional(at("centre"), violations, vector),
            radius: optional(at("radius"), violations, number).unwrap_or_default(),
        }),
        "box" => Shape::Box(v1::RegionBox {
            object_from_box: optional(at("object_from_box"), violations, pose),
            half_extents: optional(at("half_extents"), violations, vector),
        }),
        "half_space" => Shape::HalfSpace(v1::RegionHalfSpace {
            point: optional(at("point"), violations, vector),
            normal: optional(at("normal"), violations, direction),
        }),
        _ => Shape::Tube(v1::RegionTube {
            points: list(field.child("points"), table.get("points"), violations, vector),
            radius: optional(at("radius"), violations, number).unwrap_or_default(),
        }),
    };
    (violations.len() == before).then_some(v1::RegionShape { shape: Some(shape) })
}
