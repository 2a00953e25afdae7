//! `NAME.toml`: what a client gives of a `GraspObject`, under the same names.

mod known_grips;
mod regions;
mod values;

use grasp_proto::v1;
use toml::{Table, Value};

use self::{
    known_grips::known_grip,
    regions::region,
    values::{flag, group_name, list, number, optional, reject, reject_unknown, text, vector},
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
