//! Protobuf's JSON of messages, as grpcurl and all languages' libraries write it, and the form that the client library's types have.
//!
//! The library names fields as messages do, and differs in a few habits: vectors are lists, durations numbers of seconds, and
//! values of enumerations have no prefix. The contract's descriptors say where.

use std::{collections::HashMap, sync::LazyLock};

use prost::Message as _;
use prost_types::{
    DescriptorProto, FieldDescriptorProto, FileDescriptorSet,
    field_descriptor_proto::{Label, Type},
};
use serde_json::{Map, Number, Value, json};

/// Messages by their full names, such as `.grasp.v1.Pose`.
static MESSAGES: LazyLock<HashMap<String, DescriptorProto>> = LazyLock::new(|| {
    let files = FileDescriptorSet::decode(grasp_proto::FILE_DESCRIPTOR_SET)
        .unwrap_or_default()
        .file;
    let messages = files.into_iter().flat_map(|file| {
        let package = file.package().to_owned();
        let named = move |message: DescriptorProto| (format!(".{package}.{}", message.name()), message);
        file.message_type.into_iter().map(named)
    });
    messages.collect()
});

/// Durations whose names in the library do not just end in seconds.
const RENAMED: [(&str, &str); 3] = [
    ("capture_time", "capture_seconds"),
    ("least_time_between_changes", "least_seconds_between_changes"),
    ("server_time", "server_seconds"),
];

const DURATION: &str = ".google.protobuf.Duration";
const QUATERNION: &str = ".grasp.v1.Quaternion";
const VECTORS: [&str; 2] = [".grasp.v1.Vector3", ".grasp.v1.DoubleVector3"];

/// The axes of vectors and quaternions.
const AXES: [&str; 4] = ["x", "y", "z", "w"];

/// A value of the library's as protobuf's JSON of a message of the contract.
pub(crate) fn to_protobuf(message: &str, value: Value) -> Value {
    of_message(&format!(".grasp.v1.{message}"), value)
}

/// Protobuf's JSON of a message of the contract as the library reads it.
///
/// # Errors
/// The place of the first field that is not in the message, and what is wrong with it.
pub(crate) fn from_protobuf(message: &str, value: Value) -> Result<Value, String> {
    library_message(&format!(".grasp.v1.{message}"), value, "")
}

/// The name of a duration in the library.
fn seconds(field: &str) -> String {
    let renamed = RENAMED.iter().find(|(name, _)| *name == field);
    renamed.map_or_else(
        || format!("{field}_seconds"),
        |(_, library)| (*library).to_owned(),
    )
}

/// The name of a field in the library.
fn library_name(field: &FieldDescriptorProto) -> String {
    if field.type_name() == DURATION {
        seconds(field.name())
    } else {
        field.name().to_owned()
    }
}

fn is_repeated(field: &FieldDescriptorProto) -> bool {
    field.label() == Label::Repeated
}

/// Whether JSON writes a number of this kind as a text, since many readers' numbers have fewer bits.
fn is_wide(kind: Type) -> bool {
    matches!(
        kind,
        Type::Int64 | Type::Uint64 | Type::Sint64 | Type::Fixed64 | Type::Sfixed64
    )
}

fn of_message(message: &str, value: Value) -> Value {
    if VECTORS.contains(&message) || message == QUATERNION {
        let Value::Array(numbers) = value else {
            return value;
        };
        let is_single = message != VECTORS[1];
        let numbers = numbers
            .into_iter()
            .map(|number| if is_single { short(number) } else { number });
        let named = AXES.into_iter().zip(numbers);
        return Value::Object(named.map(|(axis, number)| (axis.to_owned(), number)).collect());
    }
    if message == DURATION {
        return value.as_f64().map_or(value, |seconds| json!(duration(seconds)));
    }
    let (Some(descriptor), Value::Object(fields)) = (MESSAGES.get(message), &value) else {
        return value;
    };
    let mut written = Map::new();
    for field in &descriptor.field {
        let name = library_name(field);
        let Some(value) = fields.get(&name).filter(|value| !value.is_null()) else {
            continue;
        };
        let value = value.clone();
        let value = match value {
            Value::Array(values) if is_repeated(field) => {
                Value::Array(values.into_iter().map(|value| of_field(field, value)).collect())
            }
            value => of_field(field, value),
        };
        written.insert(field.json_name().to_owned(), value);
    }
    match message {
        ".grasp.v1.TrackPolicy" if fields.get("only_changes") == Some(&json!(true)) => {
            written.insert("detail".to_owned(), json!("ANSWER_DETAIL_CHANGES"));
        }
        ".grasp.v1.HandMesh" => {
            written.insert("clientCoordinates".to_owned(), flat(fields.get("positions")));
            written.insert("triangles".to_owned(), flat(fields.get("triangles")));
        }
        _ => {}
    }
    Value::Object(written)
}

fn of_field(field: &FieldDescriptorProto, value: Value) -> Value {
    match field.r#type() {
        // Digits that a hand does not have.
        Type::Message if value.is_null() => json!({}),
        Type::Message => of_message(field.type_name(), value),
        Type::Enum => value
            .as_str()
            .map_or(Value::Null, |word| json!(enumerator(field.type_name(), word))),
        kind if is_wide(kind) => match value {
            Value::Number(number) => json!(number.to_string()),
            other => other,
        },
        Type::Float => short(value),
        _ => value,
    }
}

/// A number in single precision with as few digits as tell it from others.
fn short(number: Value) -> Value {
    let shortest = number
        .as_f64()
        .and_then(|number| (number as f32).to_string().parse().ok());
    shortest.and_then(Number::from_f64).map_or(number, Value::Number)
}

/// What names of an enumeration's values start with.
fn prefix(enumeration: &str) -> String {
    let name = enumeration.rsplit('.').next().unwrap_or_default();
    let mut prefix = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !prefix.is_empty() {
            prefix.push('_');
        }
        prefix.extend(letter.to_uppercase());
    }
    prefix + "_"
}

/// The name of an enumeration's value in the contract.
fn enumerator(enumeration: &str, word: &str) -> String {
    let word = match word {
        // Of a newer server.
        "unrecognised" => "unspecified",
        word => word,
    };
    format!("{}{}", prefix(enumeration), word.to_uppercase())
}

/// Seconds as protobuf writes a duration.
fn duration(seconds: f64) -> String {
    let text = format!("{seconds:.9}");
    format!("{}s", text.trim_end_matches('0').trim_end_matches('.'))
}

/// The numbers of a list of lists.
fn flat(value: Option<&Value>) -> Value {
    let groups = value.and_then(Value::as_array).into_iter().flatten();
    let numbers = groups.filter_map(Value::as_array).flatten();
    Value::Array(numbers.cloned().collect())
}

fn library_message(message: &str, value: Value, path: &str) -> Result<Value, String> {
    if message == DURATION {
        let seconds = value
            .as_str()
            .and_then(|text| text.strip_suffix('s')?.parse::<f64>().ok());
        return seconds
            .and_then(Number::from_f64)
            .map(Value::Number)
            .ok_or_else(|| format!("{path}: {value} is no duration, such as \"1.5s\""));
    }
    let Value::Object(fields) = value else {
        return Err(format!(
            "{path}: {value} is no object with the fields of {}",
            &message[1..]
        ));
    };
    if VECTORS.contains(&message) || message == QUATERNION {
        let axes = if message == QUATERNION {
            &AXES[..]
        } else {
            &AXES[..3]
        };
        if let Some(wrong) = fields.keys().find(|key| !axes.contains(&key.as_str())) {
            return Err(format!("{path}.{wrong}: is none of {}", axes.join(", ")));
        }
        let zero = || json!(0.0);
        return Ok(axes
            .iter()
            .map(|&axis| fields.get(axis).cloned().unwrap_or_else(zero))
            .collect());
    }
    let Some(descriptor) = MESSAGES.get(message) else {
        return Ok(Value::Object(fields));
    };
    let mut read = Map::new();
    for (key, value) in fields {
        let path = if path.is_empty() {
            key.clone()
        } else {
            format!("{path}.{key}")
        };
        let field = descriptor
            .field
            .iter()
            .find(|field| [field.json_name(), field.name()].contains(&key.as_str()));
        let Some(field) = field else {
            let known: Vec<&str> = descriptor
                .field
                .iter()
                .map(FieldDescriptorProto::json_name)
                .collect();
            return Err(format!(
                "{path}: is no field of {}; it has {}",
                &message[1..],
                known.join(", ")
            ));
        };
        let value = match value {
            Value::Null => continue,
            Value::Array(values) if is_repeated(field) => {
                let values = values.into_iter().enumerate();
                let read =
                    values.map(|(place, value)| library_field(field, value, &format!("{path}[{place}]")));
                Value::Array(read.collect::<Result<_, _>>()?)
            }
            value => library_field(field, value, &path)?,
        };
        match (message, field.name()) {
            (".grasp.v1.TrackPolicy", "detail") => {
                read.insert("only_changes".to_owned(), json!(value == json!("changes")));
            }
            (".grasp.v1.HandMesh", "client_coordinates") => {
                read.insert("positions".to_owned(), by_threes(&value));
            }
            (".grasp.v1.HandMesh", "triangles") => {
                read.insert("triangles".to_owned(), by_threes(&value));
            }
            _ => {
                read.insert(library_name(field), value);
            }
        }
    }
    Ok(Value::Object(read))
}

fn library_field(field: &FieldDescriptorProto, value: Value, path: &str) -> Result<Value, String> {
    match field.r#type() {
        Type::Message => library_message(field.type_name(), value, path),
        Type::Enum => {
            let prefix = prefix(field.type_name());
            let word = value.as_str().and_then(|name| name.strip_prefix(&prefix));
            match word {
                Some("UNSPECIFIED") => Ok(Value::Null),
                // The only enumeration whose names are not written in small letters.
                Some(word) if field.type_name() == ".grasp.v1.Strategy" => {
                    let (first, rest) = word.split_at(word.len().min(1));
                    Ok(json!(format!("{first}{}", rest.to_lowercase())))
                }
                Some(word) => Ok(json!(word.to_lowercase())),
                None => Err(format!(
                    "{path}: {value} is none of the names that start with {prefix}"
                )),
            }
        }
        kind if is_wide(kind) => match value {
            Value::String(digits) => {
                let number = digits.parse::<u64>().map(|number| json!(number));
                number.map_err(|_| format!("{path}: {digits:?} is no whole number of at least 0"))
            }
            other => Ok(other),
        },
        _ => Ok(value),
    }
}

/// Numbers in groups of three.
fn by_threes(value: &Value) -> Value {
    let numbers = value.as_array().map(Vec::as_slice).unwrap_or_default();
    numbers
        .chunks(3)
        .map(|group| Value::Array(group.to_vec()))
        .collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use grasp_client::{FindRequest, TrackPolicy, built_in::request_for};

    use super::*;

    #[test]
    fn requests_are_written_as_other_languages_write_them_and_read_again() {
        for holdout in grasp_assets::holdouts::holdouts() {
            let request = FindRequest {
                budget: Some(Duration::from_millis(1500)),
                max_attempts: Some(7),
                seed: Some(u64::MAX),
                strategy: Some(grasp_client::Strategy::Guided),
                up: Some(glam::Vec3::Y),
                convention: grasp_client::Convention::UnityFlipX,
                ..request_for(holdout)
            };
            let written = to_protobuf("FindGraspRequest", serde_json::to_value(&request).unwrap());
            assert_eq!(written["budget"], "1.5s");
            assert_eq!(
                (&written["seed"], &written["maxAttempts"]),
                (&json!("18446744073709551615"), &json!("7"))
            );
            assert_eq!(written["strategy"], "STRATEGY_GUIDED");
            assert_eq!(written["convention"], "CONVENTION_UNITY_FLIP_X");
            assert_eq!(written["up"], json!({"x": 0.0, "y": 1.0, "z": 0.0}));
            let angles = &written["presentingHand"]["angles"];
            assert!(
                angles["clientFromWrist"]["orientation"]["w"].is_number(),
                "{angles}"
            );
            assert_eq!(angles["digits"].as_array().unwrap().len(), 5);
            assert_eq!(written.get("receiver"), None);
            let read = from_protobuf("FindGraspRequest", written).unwrap();
            assert_eq!(serde_json::from_value::<FindRequest>(read).unwrap(), request);
        }
    }

    #[test]
    fn hands_as_meshes_and_policies_are_what_messages_have() {
        let mesh =
            json!({"positions": [[0, 1, 2], [3, 4, 5]], "triangles": [[0, 1, 1]], "client_from_wrist": null});
        let written = to_protobuf("HandMesh", mesh);
        assert_eq!(
            written,
            json!({"clientCoordinates": [0, 1, 2, 3, 4, 5], "triangles": [0, 1, 1]})
        );
        let read = from_protobuf("HandMesh", written).unwrap();
        assert_eq!(
            read,
            json!({"positions": [[0, 1, 2], [3, 4, 5]], "triangles": [[0, 1, 1]]})
        );
        let policy = TrackPolicy {
            only_changes: true,
            least_time_between_changes: Duration::from_millis(250),
            ..TrackPolicy::default()
        };
        let written = to_protobuf("TrackPolicy", serde_json::to_value(policy).unwrap());
        let expected = json!({
            "leastTimeBetweenChanges": "0.25s", "detail": "ANSWER_DETAIL_CHANGES", "mayChangeHand": false,
        });
        assert_eq!(written, expected);
        let read = from_protobuf("TrackPolicy", written).unwrap();
        assert_eq!(serde_json::from_value::<TrackPolicy>(read).unwrap(), policy);
    }

    #[test]
    fn what_is_wrong_is_named_by_its_place() {
        for (wrong, expected) in [
            (
                json!({"objekt": "objects/mug"}),
                "objekt: is no field of grasp.v1.FindGraspRequest",
            ),
            (json!({"up": [0, 1, 0]}), "up: [0,1,0] is no object"),
            (json!({"up": {"w": 1}}), "up.w: is none of x, y, z"),
            (json!({"budget": 2}), "budget: 2 is no duration"),
            (
                json!({"convention": "unity"}),
                "convention: \"unity\" is none of the names that start with CONVENTION_",
            ),
            (
                json!({"obstacles": [{"ball": {}}]}),
                "obstacles[0].ball: is no field of grasp.v1.Obstacle",
            ),
            (json!({"seed": "-1"}), "seed: \"-1\" is no whole number"),
        ] {
            let error = from_protobuf("FindGraspRequest", wrong).unwrap_err();
            assert!(error.starts_with(expected), "{error}");
        }
        let names = json!({"object": "objects/mug", "client_from_object": {"position": {"y": 1}}, "validity": "VALIDITY_UNSPECIFIED"});
        let read = from_protobuf("FindGraspRequest", names).unwrap();
        let request: FindRequest = serde_json::from_value(read).unwrap();
        assert_eq!(request.client_from_object.position, glam::Vec3::Y);
    }
}
