//! Protobuf's JSON of messages (feature `json`), as grpcurl and the libraries of all languages write it.

use std::sync::LazyLock;

use prost::{Message, Name};
use prost_reflect::{DescriptorPool, DynamicMessage, MessageDescriptor};
use serde_json::Value;

static MESSAGES: LazyLock<DescriptorPool> = LazyLock::new(|| {
    DescriptorPool::decode(grasp_proto::FILE_DESCRIPTOR_SET).expect("the compiled contract is sound")
});

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
}

/// A message of the contract as JSON: names in camelCase, without fields that have their default.
///
/// # Errors
/// The message is of another contract, or has a time or duration that JSON cannot represent.
pub fn to_json<M: Message + Name>(message: &M) -> Result<Value, JsonError> {
    let mut dynamic = DynamicMessage::new(descriptor::<M>()?);
    dynamic
        .transcode_from(message)
        .map_err(|error| JsonError::whole(&error))?;
    // Through text, which has the fewest digits that identify numbers of single precision.
    let text = serde_json::to_string(&dynamic).map_err(|error| JsonError::whole(&error))?;
    serde_json::from_str(&text).map_err(|error| JsonError::whole(&error))
}

/// A message of the contract from its JSON. Names may be in camelCase or as in the contract; unknown ones are errors.
///
/// # Errors
/// The first mismatch with the contract.
pub fn from_json<M: Message + Name + Default>(json: &Value) -> Result<M, JsonError> {
    let mut track = serde_path_to_error::Track::new();
    let deserializer = serde_path_to_error::Deserializer::new(json, &mut track);
    let dynamic =
        DynamicMessage::deserialize(descriptor::<M>()?, deserializer).map_err(|error| JsonError {
            path: Some(track.path().to_string()).filter(|path| path != "."),
            problem: error.to_string(),
        })?;
    dynamic.transcode_to().map_err(|error| JsonError::whole(&error))
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
    use grasp_proto::v1;
    use serde_json::json;

    use super::*;

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
            (json!({"objekt": ""}), None, "unrecognized field name 'objekt'"),
            (obstacle, Some("holdout.obstacles[0]"), "ball"),
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
