//! `NAME.toml`: the fields of a `CreateObject` request other than the mesh, under the same names.

use grasp_proto::v1;
use toml::{Table, Value};

use crate::validate::{Field, Labels, Violations, quoted};

/// The keys of a manifest.
const KEYS: [&str; 7] = [
    "mass_kg",
    "unit_metres",
    "up_axis",
    "centre_of_mass",
    "friction",
    "forbidden",
    "labels",
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
    labels: Labels,
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
            labels: self.labels,
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
    let mut optional = |key| {
        let value = table.get(key)?;
        number(Field::root(key), value, violations)
    };
    let mass_kg = optional("mass_kg");
    let unit_metres = optional("unit_metres");
    let friction = optional("friction");
    Some(Manifest {
        // A missing or wrong mass was added to the violations.
        mass_kg: mass_kg.unwrap_or(PLACEHOLDER_MASS),
        unit_metres,
        up_axis: table
            .get("up_axis")
            .and_then(|value| up_axis(Field::root("up_axis"), value, violations))
            .unwrap_or_default(),
        centre_of_mass: table
            .get("centre_of_mass")
            .and_then(|value| vector(Field::root("centre_of_mass"), value, violations)),
        friction,
        forbidden: table
            .get("forbidden")
            .map(|value| forbidden(Field::root("forbidden"), value, violations))
            .unwrap_or_default(),
        labels: table
            .get("labels")
            .map(|value| labels(Field::root("labels"), value, violations))
            .unwrap_or_default(),
    })
}

/// Labels: a table of texts.
fn labels(field: Field<'_>, value: &Value, violations: &mut Violations) -> Labels {
    let Some(table) = value.as_table() else {
        return reject(field, value, "a table of texts", violations).unwrap_or_default();
    };
    let pairs = table.iter().filter_map(|(key, value)| {
        let text = value.as_str().map(str::to_owned);
        let text = text.or_else(|| reject(field.child(key), value, "a text", violations))?;
        Some((key.clone(), text))
    });
    pairs.collect()
}

fn reject_unknown(table: &Table, parent: Option<Field<'_>>, known: &[&str], violations: &mut Violations) {
    for key in table.keys().filter(|key| !known.contains(&key.as_str())) {
        let description = format!("is unknown; the keys are {}", known.join(", "));
        match parent {
            Some(parent) => violations.add(parent.child(key), description),
            None => violations.add(Field::root(key), description),
        }
    }
}

/// A number, with or without a fraction.
fn number(field: Field<'_>, value: &Value, violations: &mut Violations) -> Option<f32> {
    match value {
        Value::Float(number) => Some(*number as f32),
        Value::Integer(number) => Some(*number as f32),
        _ => reject(field, value, "a number", violations),
    }
}

/// The axis that points up.
fn up_axis(field: Field<'_>, value: &Value, violations: &mut Violations) -> Option<v1::UpAxis> {
    match value.as_str() {
        Some("y") => Some(v1::UpAxis::Y),
        Some("z") => Some(v1::UpAxis::Z),
        _ => reject(field, value, "\"y\" or \"z\"", violations),
    }
}

fn vector(field: Field<'_>, value: &Value, violations: &mut Violations) -> Option<v1::Vector3> {
    let Some([x, y, z]) = value.as_array().map(Vec::as_slice) else {
        return reject(
            field,
            value,
            "three numbers in metres, as in [0, 0.1, 0]",
            violations,
        );
    };
    let mut at = |place, value| number(field.at(place), value, violations);
    let (x, y, z) = (at(0, x), at(1, y), at(2, z));
    Some(v1::Vector3 { x: x?, y: y?, z: z? })
}

fn forbidden(field: Field<'_>, value: &Value, violations: &mut Violations) -> v1::ForbiddenSurfaces {
    let Some(table) = value.as_table() else {
        return reject(field, value, "a table with groups, triangles or both", violations)
            .unwrap_or_default();
    };
    reject_unknown(table, Some(field), &FORBIDDEN_KEYS, violations);
    v1::ForbiddenSurfaces {
        groups: list(
            field.child("groups"),
            table.get("groups"),
            "a name in quotes",
            violations,
            |value| value.as_str().map(str::to_owned),
        ),
        triangles: list(
            field.child("triangles"),
            table.get("triangles"),
            "a triangle's number, counted from 0",
            violations,
            |value| value.as_integer().and_then(|number| u32::try_from(number).ok()),
        ),
    }
}

/// The elements of an array; none of them if one is wrong, because later violations would give wrong indices for the
/// others.
fn list<T>(
    field: Field<'_>,
    value: Option<&Value>,
    needed: &str,
    violations: &mut Violations,
    element: impl Fn(&Value) -> Option<T>,
) -> Vec<T> {
    let Some(value) = value else {
        return Vec::new();
    };
    let Some(values) = value.as_array() else {
        return reject(field, value, "a list in brackets", violations).unwrap_or_default();
    };
    let elements: Vec<T> = values
        .iter()
        .enumerate()
        .filter_map(|(place, value)| {
            element(value).or_else(|| reject(field.at(place), value, needed, violations))
        })
        .collect();
    if elements.len() == values.len() {
        elements
    } else {
        Vec::new()
    }
}

/// Adds the violation of a value of the wrong type.
fn reject<T>(field: Field<'_>, value: &Value, needed: &str, violations: &mut Violations) -> Option<T> {
    let text = match value {
        Value::String(text) => quoted(text),
        Value::Table(_) => "a table".to_owned(),
        Value::Array(values) => format!("a list of {}", values.len()),
        other => other.to_string(),
    };
    violations.add(field, format_args!("is {text}; it must be {needed}"));
    None
}
