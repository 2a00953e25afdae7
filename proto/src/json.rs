//! Protobuf's JSON of messages (feature `json`), as grpcurl and the libraries of all languages write it.

use std::sync::LazyLock;

use prost::{Message, Name};
use prost_reflect::{DescriptorPool, DynamicMessage, Kind, MessageDescriptor};
use serde_json::Value;
use serde_path_to_error::{Path, Segment, Track};

use crate::FILE_DESCRIPTOR_SET;

static MESSAGES: LazyLock<DescriptorPool> =
    LazyLock::new(|| DescriptorPool::decode(FILE_DESCRIPTOR_SET).expect("the compiled contract is sound"));

/// JSON that does not match its message.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{problem}", path.as_ref().map(|path| format!("{path}: ")).unwrap_or_default())]
pub struct JsonError {
    /// The path in the JSON, such as `holdout.obstacles[0]`; `None` for all of it.
    pub path: Option<String>,
    /// The problem at that path.
    pub problem: String,
}

impl JsonError {
    fn whole(problem: &impl ToString) -> Self {
        Self {
            path: None,
            problem: problem.to_string(),
        }
    }

    /// A mismatch at a path of a message.
    fn at(path: &Path, problem: &impl ToString, message: &MessageDescriptor) -> Self {
        let mismatch = Self {
            path: Some(path.to_string()).filter(|path| path != "."),
            problem: problem.to_string(),
        };
        mismatch
            .with_fields_of(message_at(path, message))
            .unwrap_or(mismatch)
    }

    /// The same error, if it is about an unknown field, with the fields that its message has.
    fn with_fields_of(&self, message: Option<MessageDescriptor>) -> Option<Self> {
        let (_, unknown) = self.problem.split_once("unrecognized field name '")?;
        let (unknown, _) = unknown.split_once('\'')?;
        let message = message?;
        let fields: Vec<String> = message
            .fields()
            .map(|field| field.json_name().to_owned())
            .collect();
        let path = self.path.iter().map(String::as_str).chain([unknown]);
        Some(Self {
            path: Some(path.collect::<Vec<_>>().join(".")),
            problem: format!("is no field of {}; it has {}", message.name(), fields.join(", ")),
        })
    }
}

/// The message at a path of another one.
fn message_at(path: &Path, message: &MessageDescriptor) -> Option<MessageDescriptor> {
    let mut at = message.clone();
    for segment in path {
        let Segment::Map { key } = segment else { continue };
        let field = at
            .get_field_by_json_name(key)
            .or_else(|| at.get_field_by_name(key));
        // A key of a map is no field of its entries.
        let Some(field) = field else { continue };
        let Kind::Message(inner) = field.kind() else {
            return None;
        };
        at = inner;
    }
    Some(at)
}

/// A message of the contract as JSON: names in camelCase, without fields that have their default.
///
/// # Errors
/// The message is of another contract, or has a time or duration that JSON cannot represent.
pub fn to_json<M: Message + Name>(message: &M) -> Result<Value, JsonError> {
    // Through text, which has the fewest digits that identify numbers of single precision.
    let text = text_of(&descriptor::<M>()?, &message.encode_to_vec())?;
    serde_json::from_slice(&text).map_err(|error| JsonError::whole(&error))
}

/// A message of the contract from its JSON. Names may be in camelCase or as in the contract; unknown ones are errors.
///
/// # Errors
/// The first mismatch with the contract.
pub fn from_json<M: Message + Name + Default>(json: &Value) -> Result<M, JsonError> {
    let descriptor = descriptor::<M>()?;
    let mut track = Track::new();
    let deserializer = serde_path_to_error::Deserializer::new(json, &mut track);
    let dynamic = DynamicMessage::deserialize(descriptor.clone(), deserializer)
        .map_err(|error| JsonError::at(&track.path(), &error, &descriptor))?;
    dynamic.transcode_to().map_err(|error| JsonError::whole(&error))
}

/// The JSON text of an encoded message, as [`to_json`] writes it.
///
/// # Errors
/// These are no bytes of this message, or have a time or duration that JSON cannot represent.
pub fn text_of(descriptor: &MessageDescriptor, message: &[u8]) -> Result<Vec<u8>, JsonError> {
    let dynamic =
        DynamicMessage::decode(descriptor.clone(), message).map_err(|error| JsonError::whole(&error))?;
    serde_json::to_vec(&dynamic).map_err(|error| JsonError::whole(&error))
}

/// The encoded message of a JSON text, as [`from_json`] reads it.
///
/// # Errors
/// The text is no JSON, nested more than 128 levels deep, or does not match the message: the first mismatch.
pub fn bytes_of(descriptor: &MessageDescriptor, text: &[u8]) -> Result<Vec<u8>, JsonError> {
    let mut reader = serde_json::Deserializer::from_slice(text);
    let read = DynamicMessage::deserialize(descriptor.clone(), &mut reader);
    if let Ok(dynamic) = &read
        && reader.end().is_ok()
    {
        return Ok(dynamic.encode_to_vec());
    }
    // Once more for the place of the mismatch: following it would slow down every message.
    let mut reader = serde_json::Deserializer::from_slice(text);
    let mut track = Track::new();
    let tracking = serde_path_to_error::Deserializer::new(&mut reader, &mut track);
    let read = DynamicMessage::deserialize(descriptor.clone(), tracking);
    match read.and_then(|_| reader.end()) {
        Ok(()) => Err(JsonError::whole(&"it is no JSON")),
        Err(error) => Err(JsonError::at(&track.path(), &error, descriptor)),
    }
}

fn descriptor<M: Name>() -> Result<MessageDescriptor, JsonError> {
    let name = M::full_name();
    MESSAGES
        .get_message_by_name(&name)
        .ok_or_else(|| JsonError::whole(&format!("{name} is no message of grasp.v1")))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use glam::{Quat, Vec3};
    use serde_json::json;

    use super::*;
    use crate::v1;

    fn request() -> v1::FindGraspRequest {
        let hand = v1::HandPose::new("rigs/adult", v1::Handedness::Left)
            .with_client_from_wrist(v1::Pose::new(Vec3::new(0.1, 0.2, 0.3), Quat::IDENTITY))
            .with_digits([Some(v1::DigitAngles::default()); 5]);
        v1::FindGraspRequest::new("objects/remote")
            .with_presenting_hand(hand)
            .with_obstacle(v1::Shape::ball(Vec3::Y, 0.1))
            .with_budget(Duration::from_millis(1500))
            .with_seed(u64::MAX)
            .with_convention(v1::Convention::UnityFlipX)
    }

    #[test]
    fn messages_are_written_as_other_languages_write_them_and_read_again() {
        let written = to_json(&request()).unwrap();
        assert_eq!(
            written["search"],
            json!({"budget": "1.500s", "seed": "18446744073709551615"})
        );
        assert_eq!(
            written["output"],
            json!({"convention": "CONVENTION_UNITY_FLIP_X"})
        );
        let hand = &written["holdout"]["presentingHand"]["pose"];
        assert_eq!(
            hand["clientFromWrist"],
            json!({"position": {"x": 0.1, "y": 0.2, "z": 0.3}, "orientation": {"w": 1.0}})
        );
        assert_eq!((&hand["thumb"], hand.get("joints")), (&json!({}), None));
        assert_eq!(from_json::<v1::FindGraspRequest>(&written).unwrap(), request());
    }

    #[test]
    fn errors_are_named_by_their_place() {
        let obstacle = json!({"holdout": {"obstacles": [{"ball": {}}]}});
        let (budget, seed) = (json!({"budget": 2}), json!({"seed": "-1"}));
        for (wrong, path, problem) in [
            (
                json!({"objekt": ""}),
                Some("objekt"),
                "FindGraspRequest; it has holdout, receiver",
            ),
            (obstacle, Some("holdout.obstacles[0].ball"), "Shape; it has "),
            (json!({"search": budget}), Some("search.budget"), "2"),
            (json!({"search": seed}), Some("search.seed"), "invalid digit"),
        ] {
            let error = from_json::<v1::FindGraspRequest>(&wrong).unwrap_err();
            assert_eq!(error.path.as_deref(), path, "{error}");
            assert!(error.to_string().contains(problem), "{error}");
        }
    }

    #[test]
    fn enumerations_of_a_newer_server_can_be_written_but_not_malformed_durations() {
        let answer = v1::FindGraspResponse {
            outcome: 77,
            ..v1::FindGraspResponse::default()
        };
        assert_eq!(to_json(&answer).unwrap(), json!({"outcome": 77}));
        let (seconds, nanos) = (i64::MAX, i32::MAX);
        let report = v1::SearchReport {
            search_time: Some(prost_types::Duration { seconds, nanos }),
            ..v1::SearchReport::default()
        };
        let error = to_json(&report).unwrap_err();
        assert!(error.problem.contains("duration"), "{error}");
    }
}
