//! `NAME.toml`: the fields of a `CreateObject` request other than the mesh, under the same names.

mod known_grips;
mod regions;
mod values;

use grasp_proto::v1;
use toml::{Table, Value};

use self::{
    known_grips::known_grip,
    regions::region,
    values::{
        group_name, list, number, one_of, optional, reject, reject_unknown, text, triangle_index, vector,
    },
};
use crate::validate::{Field, Labels, Violations};

/// The keys of a manifest.
const KEYS: [&str; 10] = [
    "mass_kg",
    "unit_metres",
    "up_axis",
    "centre_of_mass",
    "friction",
    "forbidden",
    "regions",
    "known_grips",
    "labels",
    "parts",
];

/// The keys of `forbidden`.
const FORBIDDEN_KEYS: [&str; 2] = ["groups", "triangles"];

/// Mass in kilograms for further checks if none is given; no object gets it.
const PLACEHOLDER_MASS: f32 = 1.0;

/// A manifest with unchecked values.
#[derive(Debug)]
pub(super) struct Manifest {
    mass_kg: f32,
    unit_metres: Option<f32>,
    up_axis: v1::UpAxis,
    centre_of_mass: Option<v1::Vector3>,
    friction: Option<f32>,
    forbidden: v1::ForbiddenSurfaces,
    regions: Vec<v1::Region>,
    known_grips: Vec<v1::KnownGrip>,
    labels: Labels,
    parts: Vec<String>,
}

impl Manifest {
    /// The request that would create the object.
    pub(super) fn into_request(self, id: &str, mesh: Vec<u8>) -> v1::CreateObjectRequest {
        v1::CreateObjectRequest {
            object_id: id.to_owned(),
            mesh,
            up_axis: self.up_axis.into(),
            unit_metres: self.unit_metres,
            mass_kg: self.mass_kg,
            centre_of_mass: self.centre_of_mass,
            friction: self.friction,
            forbidden: Some(self.forbidden),
            regions: self.regions,
            known_grips: self.known_grips,
            labels: self.labels,
            parts: self.parts,
            ..Default::default()
        }
    }
}

/// Reads a manifest key by key, to report everything that is wrong with it. None if it is not TOML.
pub(super) fn read_manifest(bytes: &[u8], violations: &mut Violations) -> Option<Manifest> {
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
        violations.add(
            Field::root("mass_kg"),
            "is missing; it must be the mass in kilograms",
        );
    }
    let at = |key| (Field::root(key), table.get(key));
    Some(Manifest {
        // A missing or wrong mass was added to the violations.
        mass_kg: optional(at("mass_kg"), violations, number).unwrap_or(PLACEHOLDER_MASS),
        unit_metres: optional(at("unit_metres"), violations, number),
        friction: optional(at("friction"), violations, number),
        up_axis: optional(at("up_axis"), violations, up_axis).unwrap_or_default(),
        centre_of_mass: optional(at("centre_of_mass"), violations, vector),
        forbidden: optional(at("forbidden"), violations, forbidden).unwrap_or_default(),
        regions: list(Field::root("regions"), table.get("regions"), violations, region),
        known_grips: list(
            Field::root("known_grips"),
            table.get("known_grips"),
            violations,
            known_grip,
        ),
        labels: optional(at("labels"), violations, labels).unwrap_or_default(),
        parts: list(Field::root("parts"), table.get("parts"), violations, group_name),
    })
}

/// Labels: a table of texts.
fn labels(field: Field<'_>, value: &Value, violations: &mut Violations) -> Option<Labels> {
    let Some(table) = value.as_table() else {
        return reject(field, value, "a table of texts", violations);
    };
    let pairs = table.iter().filter_map(|(key, value)| {
        let text = text(field.child(key), value, "a text", violations)?;
        Some((key.clone(), text))
    });
    Some(pairs.collect())
}

/// The axis that points up.
fn up_axis(field: Field<'_>, value: &Value, violations: &mut Violations) -> Option<v1::UpAxis> {
    let words = [("y", v1::UpAxis::Y), ("z", v1::UpAxis::Z)];
    one_of(field, value, &words, violations)
}

fn forbidden(field: Field<'_>, value: &Value, violations: &mut Violations) -> Option<v1::ForbiddenSurfaces> {
    let Some(table) = value.as_table() else {
        return reject(field, value, "a table with groups, triangles or both", violations);
    };
    reject_unknown(table, Some(field), &FORBIDDEN_KEYS, violations);
    Some(v1::ForbiddenSurfaces {
        groups: list(field.child("groups"), table.get("groups"), violations, group_name),
        triangles: list(
            field.child("triangles"),
            table.get("triangles"),
            violations,
            triangle_index,
        ),
    })
}
