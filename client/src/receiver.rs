//! The receiver's body and the arm of a posed hand.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::pose::Pose;

/// Where a receiver is expected to stand of whose body nothing is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReceiverStance {
    /// Opposite the presenting hand or up to 30 degrees to either side: grasps whose forearm comes from there are preferred.
    FacingGiver,
    /// Anywhere: forearms may come from all sides alike. Cannot be combined with a [`Receiver`].
    Any,
}

/// The receiver's body, as far as it decides where the arm of the receiving hand comes from. The arm has to reach the wrist:
/// attempts whose wrist it does not reach end with [`Rejection::UnmetConstraint`](crate::Rejection::UnmetConstraint).
///
/// In JSON: `{"client_shoulder": [x, y, z]}` or `{"standing": {…}}`, with `upper_arm_length` and `forearm_length` if known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Fields", into = "Fields")]
pub struct Receiver {
    /// Where the shoulder is, within 3 m of the object's origin.
    pub body: ReceiverBody,
    /// Length from the shoulder joint to the elbow; 0.1 to 0.6 m. Metres, or centimetres in the Unreal convention. None: 0.186
    /// of the height or, without one, 0.30 m.
    pub upper_arm_length: Option<f32>,
    /// Length from the elbow to the wrist, with the same limits and unit. None: 0.146 of the height or, without one, 0.26 m.
    pub forearm_length: Option<f32>,
}

/// What is known of the receiver's body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReceiverBody {
    /// The shoulder joint of the receiving hand's side, in the client's frame. Requires
    /// [`ReceivingHand::handedness`](crate::ReceivingHand::handedness).
    Shoulder(Vec3),
    /// A standing body, from which the shoulder of either side follows.
    Standing(StandingBody),
}

/// A receiver by height and where the feet are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandingBody {
    /// The root's frame in the client's frame: its origin on the ground between the feet, its up axis along the body. In
    /// `OpenXR`'s axes the body faces -Z, in Unity's +Z, in Unreal's +X, in Godot's -Z.
    #[serde(default)]
    pub client_from_root: Pose,
    /// Height from the sole to the crown; 0.8 to 2.5 m. Metres, or centimetres in the Unreal convention.
    pub height: f32,
}

/// The arm of a posed hand: the least strained one that is clear of the giver, the obstacles and the object.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Arm {
    /// The shoulder joint, in the client's frame.
    pub client_shoulder: Vec3,
    /// The elbow, in the client's frame.
    pub client_elbow: Vec3,
    /// Flexion of the wrist toward the palm, in radians; negative: extension.
    pub wrist_flexion: f32,
    /// Deviation of the wrist toward the little finger, in radians; negative: toward the thumb.
    pub wrist_deviation: f32,
    /// True if the shoulder is not that of the request's receiver, but where a receiver who faces the giver would have it.
    pub assumed: bool,
}

impl Receiver {
    /// A receiver with this shoulder joint on the receiving hand's side, in the client's frame, and an adult's arm.
    pub const fn with_shoulder(client_shoulder: Vec3) -> Self {
        Self {
            body: ReceiverBody::Shoulder(client_shoulder),
            upper_arm_length: None,
            forearm_length: None,
        }
    }

    /// A standing receiver, with arms in proportion to the height.
    pub const fn standing(client_from_root: Pose, height: f32) -> Self {
        Self {
            body: ReceiverBody::Standing(StandingBody {
                client_from_root,
                height,
            }),
            upper_arm_length: None,
            forearm_length: None,
        }
    }
}

/// A receiver in JSON, with the fields of the API's message.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Fields {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    client_shoulder: Option<Vec3>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    standing: Option<StandingBody>,
    #[serde(default)]
    upper_arm_length: Option<f32>,
    #[serde(default)]
    forearm_length: Option<f32>,
}

impl TryFrom<Fields> for Receiver {
    type Error = &'static str;

    fn try_from(fields: Fields) -> Result<Self, Self::Error> {
        let body = match (fields.client_shoulder, fields.standing) {
            (Some(shoulder), None) => ReceiverBody::Shoulder(shoulder),
            (None, Some(standing)) => ReceiverBody::Standing(standing),
            _ => return Err("a receiver must have either client_shoulder or standing"),
        };
        Ok(Self {
            body,
            upper_arm_length: fields.upper_arm_length,
            forearm_length: fields.forearm_length,
        })
    }
}

impl From<Receiver> for Fields {
    fn from(receiver: Receiver) -> Self {
        let (client_shoulder, standing) = match receiver.body {
            ReceiverBody::Shoulder(shoulder) => (Some(shoulder), None),
            ReceiverBody::Standing(standing) => (None, Some(standing)),
        };
        Self {
            client_shoulder,
            standing,
            upper_arm_length: receiver.upper_arm_length,
            forearm_length: receiver.forearm_length,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;

    #[test]
    fn both_forms_round_trip_through_json() {
        let root = Pose::new(Vec3::new(0.0, 0.0, 1.0), Quat::from_rotation_y(0.5));
        let receivers = [
            Receiver {
                forearm_length: Some(0.25),
                ..Receiver::with_shoulder(Vec3::new(0.5, 1.25, 1.0))
            },
            Receiver::standing(root, 1.75),
        ];
        for receiver in receivers {
            let text = serde_json::to_string(&receiver).unwrap();
            assert_eq!(
                serde_json::from_str::<Receiver>(&text).unwrap(),
                receiver,
                "{text}"
            );
        }
        let short = r#"{"standing": {"height": 1.5}}"#;
        let expected = Receiver::standing(Pose::IDENTITY, 1.5);
        assert_eq!(serde_json::from_str::<Receiver>(short).unwrap(), expected);
    }

    #[test]
    fn a_receiver_has_one_body() {
        for text in [
            "{}",
            r#"{"client_shoulder": [0, 0, 0], "standing": {"height": 1.5}}"#,
            r#"{"client_shoulder": [0, 0, 0], "height": 1.5}"#,
        ] {
            assert!(serde_json::from_str::<Receiver>(text).is_err(), "{text}");
        }
    }
}
