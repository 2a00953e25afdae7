//! Values of a manifest. Each function adds what is wrong with a value to the violations, and returns none then.

use grasp_proto::v1;
use toml::{Table, Value};

use crate::validate::{Field, Violations, quoted};

/// Adds a violation for every key that is not known.
pub(super) fn reject_unknown(
    table: &Table,
    parent: Option<Field<'_>>,
    known: &[&str],
    violations: &Violations,
) {
    for key in table.keys().filter(|key| !known.contains(&key.as_str())) {
        let description = format!("is unknown; the keys are {}", known.join(", "));
        match parent {
            Some(parent) => violations.add(parent.child(key), description),
            None => violations.add(key, description),
        }
    }
}

/// A table that has none but the known keys.
pub(super) fn table_of<'v>(
    field: Field<'_>,
    value: &'v Value,
    known: &[&str],
    violations: &Violations,
) -> Option<&'v Table> {
    let Some(table) = value.as_table() else {
        return reject(
            field,
            value,
            &format!("a table with {}", known.join(", ")),
            violations,
        );
    };
    reject_unknown(table, Some(field), known, violations);
    Some(table)
}

/// The value of a key that must be there.
pub(super) fn required<'v>(
    field: Field<'_>,
    value: Option<&'v Value>,
    needed: &str,
    violations: &Violations,
) -> Option<&'v Value> {
    if value.is_none() {
        violations.add(field, format_args!("is missing; it must be {needed}"));
    }
    value
}

/// What is read of a value. `None` if it is absent, too.
pub(super) fn optional<T>(
    (field, value): (Field<'_>, Option<&Value>),
    violations: &Violations,
    read: impl FnOnce(Field<'_>, &Value, &Violations) -> Option<T>,
) -> Option<T> {
    read(field, value?, violations)
}

/// A number, with or without a fraction.
pub(super) fn number(field: Field<'_>, value: &Value, violations: &Violations) -> Option<f32> {
    match value {
        Value::Float(number) => Some(*number as f32),
        Value::Integer(number) => Some(*number as f32),
        _ => reject(field, value, "a number", violations),
    }
}

/// True or false.
pub(super) fn flag(field: Field<'_>, value: &Value, violations: &Violations) -> Option<bool> {
    value
        .as_bool()
        .or_else(|| reject(field, value, "true or false", violations))
}

/// A text; `needed` says what it means.
pub(super) fn text(field: Field<'_>, value: &Value, needed: &str, violations: &Violations) -> Option<String> {
    match value.as_str() {
        Some(text) => Some(text.to_owned()),
        None => reject(field, value, needed, violations),
    }
}

/// The name of a part of the mesh.
pub(super) fn group_name(field: Field<'_>, value: &Value, violations: &Violations) -> Option<String> {
    text(field, value, "a name in quotes", violations)
}

/// The place of a triangle in the file.
pub(super) fn triangle_index(field: Field<'_>, value: &Value, violations: &Violations) -> Option<u32> {
    let index = value.as_integer().and_then(|number| u32::try_from(number).ok());
    index.or_else(|| reject(field, value, "a triangle's number, counted from 0", violations))
}

/// One of some words.
pub(super) fn one_of<T: Copy>(
    field: Field<'_>,
    value: &Value,
    words: &[(&str, T)],
    violations: &Violations,
) -> Option<T> {
    let word = words.iter().find(|(word, _)| value.as_str() == Some(word));
    word.map(|&(_, meaning)| meaning)
        .or_else(|| reject(field, value, &listed(words), violations))
}

/// The words in quotes: `"a", "b" or "c"`.
pub(super) fn listed<T>(words: &[(&str, T)]) -> String {
    let quoted: Vec<String> = words.iter().map(|(word, _)| format!("{word:?}")).collect();
    match quoted.as_slice() {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        all => all.join(""),
    }
}

/// Three numbers.
pub(super) fn vector(field: Field<'_>, value: &Value, violations: &Violations) -> Option<v1::Vector3> {
    let needed = "three numbers in meters, as in [0, 0.1, 0]";
    let [x, y, z] = numbers(field, value, needed, violations)?;
    Some(v1::Vector3 { x, y, z })
}

/// A direction of any length.
pub(super) fn direction(field: Field<'_>, value: &Value, violations: &Violations) -> Option<v1::Vector3> {
    let [x, y, z] = numbers(field, value, "three numbers, as in [0, 1, 0]", violations)?;
    Some(v1::Vector3 { x, y, z })
}

/// A pose as a table; what is absent of it is that of the identity.
pub(super) fn pose(field: Field<'_>, value: &Value, violations: &Violations) -> Option<v1::Pose> {
    let before = violations.len();
    let table = table_of(field, value, &["position", "orientation"], violations)?;
    let position = optional(
        (field.child("position"), table.get("position")),
        violations,
        vector,
    );
    let orientation = table.get("orientation").and_then(|value| {
        let needed = "a quaternion x, y, z, w, as in [0, 0, 0, 1]";
        let [x, y, z, w] = numbers(field.child("orientation"), value, needed, violations)?;
        Some(v1::Quaternion { x, y, z, w })
    });
    (violations.len() == before).then_some(v1::Pose {
        position,
        orientation,
    })
}

/// As many numbers as are needed.
fn numbers<const N: usize>(
    field: Field<'_>,
    value: &Value,
    needed: &str,
    violations: &Violations,
) -> Option<[f32; N]> {
    let Some(values) = value.as_array().filter(|values| values.len() == N) else {
        return reject(field, value, needed, violations);
    };
    let read = elements(field, values, violations, number);
    <[f32; N]>::try_from(read).ok()
}

/// The elements of an array; none of them if one is wrong, because later violations would give wrong indices for the
/// others.
pub(super) fn list<T>(
    field: Field<'_>,
    value: Option<&Value>,
    violations: &Violations,
    element: impl FnMut(Field<'_>, &Value, &Violations) -> Option<T>,
) -> Vec<T> {
    let Some(value) = value else {
        return Vec::new();
    };
    let Some(values) = value.as_array() else {
        return reject(field, value, "a list in brackets", violations).unwrap_or_default();
    };
    let elements = elements(field, values, violations, element);
    if elements.len() == values.len() {
        elements
    } else {
        Vec::new()
    }
}

/// Those elements that are right.
fn elements<T>(
    field: Field<'_>,
    values: &[Value],
    violations: &Violations,
    mut element: impl FnMut(Field<'_>, &Value, &Violations) -> Option<T>,
) -> Vec<T> {
    let read = values
        .iter()
        .enumerate()
        .filter_map(|(place, value)| element(field.at(place), value, violations));
    read.collect()
}

/// Adds the violation of a value of the wrong type.
pub(super) fn reject<T>(field: Field<'_>, value: &Value, needed: &str, violations: &Violations) -> Option<T> {
    let text = match value {
        Value::String(text) => quoted(text),
        Value::Table(_) => "a table".to_owned(),
        Value::Array(values) => format!("a list of {}", values.len()),
        other => other.to_string(),
    };
    violations.add(field, format_args!("is {text}; it must be {needed}"));
    None
}
