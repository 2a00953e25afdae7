//! The record of a saved rig: what a client sent to create it, from which the rig is made again at the start.

use std::{collections::BTreeMap, sync::Arc};

use grasp_proto::v1;
use object_store::Error;
use prost::Message;

use crate::saved::{Records, SavedFiles, Unreadable, folders::RIGS};

/// Largest record in bytes: a model of the largest size that a server can be configured to take, and what is beside it.
const MAX_RECORD: u64 = 1 << 30;

/// The digits, thumb first.
const DIGITS: [v1::Digit; 5] = [
    v1::Digit::Thumb,
    v1::Digit::Index,
    v1::Digit::Middle,
    v1::Digit::Ring,
    v1::Digit::Little,
];

/// The records of rigs.
pub(crate) fn saved_rigs(files: Arc<SavedFiles>) -> Records {
    Records::new(files, RIGS, MAX_RECORD)
}

/// The request that made a rig.
///
/// # Errors
/// It cannot be read; within, what is wrong with the record.
pub(crate) async fn saved_request(
    rigs: &Records,
    id: &str,
) -> Result<Result<v1::CreateRigRequest, Unreadable>, Error> {
    let parse = |message: &[u8]| SavedRig::from_message(id, message).map(Into::into);
    rigs.read(id, parse).await
}

/// What a client sent. Joints and nodes are the contract's messages, whose numbers never change.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct SavedRig {
    #[prost(string, tag = "1")]
    id: String,
    #[prost(bytes = "vec", tag = "2")]
    model: Vec<u8>,
    #[prost(message, optional, tag = "3")]
    joints: Option<HandsAtRest>,
    #[prost(message, repeated, tag = "4")]
    joint_map: Vec<v1::RigNode>,
    #[prost(message, repeated, tag = "5")]
    limits: Vec<Limits>,
    #[prost(enumeration = "v1::Handedness", tag = "6")]
    side: i32,
    #[prost(bytes = "vec", tag = "7")]
    other_model: Vec<u8>,
    /// 0: 1.
    #[prost(float, tag = "8")]
    width_scale: f32,
    #[prost(btree_map = "string, float", tag = "9")]
    radii: BTreeMap<String, f32>,
}

#[derive(Clone, PartialEq, Message)]
struct HandsAtRest {
    #[prost(message, repeated, tag = "1")]
    hands: Vec<HandAtRest>,
}

#[derive(Clone, PartialEq, Message)]
struct HandAtRest {
    #[prost(enumeration = "v1::Handedness", tag = "1")]
    side: i32,
    #[prost(message, repeated, tag = "3")]
    joints: Vec<v1::JointPose>,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Limits {
    #[prost(message, optional, tag = "1")]
    base_yaw: Option<Range>,
    #[prost(message, optional, tag = "2")]
    base_pitch: Option<Range>,
    #[prost(message, optional, tag = "3")]
    second_pitch: Option<Range>,
    #[prost(message, optional, tag = "4")]
    third_pitch: Option<Range>,
    /// 1 is the thumb. 0, in records of version 0.1: its place in the list says it.
    #[prost(uint32, tag = "5")]
    digit: u32,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Range {
    #[prost(float, tag = "1")]
    min: f32,
    #[prost(float, tag = "2")]
    max: f32,
}

impl SavedRig {
    /// The record of the rig with this id.
    ///
    /// # Errors
    /// What is wrong with the message.
    fn from_message(id: &str, message: &[u8]) -> Result<Self, Unreadable> {
        let saved = Self::decode(message).map_err(|_| Unreadable::Message)?;
        if saved.id == id {
            Ok(saved)
        } else {
            Err(Unreadable::Name)
        }
    }
}

impl From<v1::CreateRigRequest> for SavedRig {
    fn from(request: v1::CreateRigRequest) -> Self {
        let mut models = request.models.into_iter();
        let hands: Vec<HandAtRest> = request.joints.into_iter().map(Into::into).collect();
        Self {
            id: request.rig_id,
            model: models.next().unwrap_or_default(),
            joints: (!hands.is_empty()).then_some(HandsAtRest { hands }),
            joint_map: request.joint_map,
            limits: request.limits.into_iter().map(Into::into).collect(),
            side: request.handedness,
            other_model: models.next().unwrap_or_default(),
            width_scale: request.width_scale.unwrap_or_default(),
            radii: request.radii,
        }
    }
}

impl From<SavedRig> for v1::CreateRigRequest {
    fn from(saved: SavedRig) -> Self {
        let models = [saved.model, saved.other_model];
        let limits = saved.limits.into_iter().enumerate();
        Self {
            rig_id: saved.id,
            models: models.into_iter().filter(|model| !model.is_empty()).collect(),
            joints: saved
                .joints
                .into_iter()
                .flat_map(|joints| joints.hands)
                .map(Into::into)
                .collect(),
            joint_map: saved.joint_map,
            limits: limits.map(|(place, limits)| limits.of_digit_at(place)).collect(),
            handedness: saved.side,
            width_scale: Some(saved.width_scale).filter(|scale| *scale != 0.0),
            radii: saved.radii,
        }
    }
}

impl From<v1::HandJoints> for HandAtRest {
    fn from(hand: v1::HandJoints) -> Self {
        Self {
            side: hand.handedness,
            joints: hand.joints,
        }
    }
}

impl From<HandAtRest> for v1::HandJoints {
    fn from(hand: HandAtRest) -> Self {
        Self::new(hand.side(), hand.joints)
    }
}

impl From<v1::DigitLimits> for Limits {
    fn from(limits: v1::DigitLimits) -> Self {
        let digit = limits.digit();
        let [min, max] = [limits.min, limits.max].map(Option::unwrap_or_default);
        let range = |min, max| Some(Range { min, max });
        Self {
            base_yaw: range(min.base_yaw, max.base_yaw),
            base_pitch: range(min.base_pitch, max.base_pitch),
            second_pitch: range(min.second_pitch, max.second_pitch),
            third_pitch: range(
                min.third_pitch.unwrap_or_default(),
                max.third_pitch.unwrap_or_default(),
            ),
            digit: DIGITS
                .iter()
                .position(|&other| other == digit)
                .map_or(0, |place| place as u32 + 1),
        }
    }
}

impl Limits {
    /// The limits, which are at this place of a list.
    fn of_digit_at(self, place: usize) -> v1::DigitLimits {
        let place = (self.digit as usize).checked_sub(1).unwrap_or(place);
        let ranges = [
            self.base_yaw,
            self.base_pitch,
            self.second_pitch,
            self.third_pitch,
        ]
        .map(Option::unwrap_or_default);
        v1::DigitLimits {
            digit: DIGITS.get(place).copied().unwrap_or_default().into(),
            min: Some(v1::DigitAngles::new(ranges.map(|range| range.min))),
            max: Some(v1::DigitAngles::new(ranges.map(|range| range.max))),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;

    fn read(saved: &SavedRig) -> v1::CreateRigRequest {
        let bytes = saved.encode_to_vec();
        let saved = SavedRig::from_message("mine", &bytes);
        saved.expect("it is a record").into()
    }

    fn limits(digit: v1::Digit) -> v1::DigitLimits {
        v1::DigitLimits {
            digit: digit.into(),
            min: Some(v1::DigitAngles::new([-0.1, 0.0, 0.1, 0.2])),
            max: Some(v1::DigitAngles::new([0.1, 1.0, 1.1, 1.2])),
        }
    }

    #[test]
    fn what_a_client_sent_is_read_as_it_was_written() {
        let of_models = v1::CreateRigRequest {
            rig_id: "mine".to_owned(),
            models: vec![vec![1, 2], vec![3]],
            joint_map: vec![v1::RigNode {
                node: "a".to_owned(),
                joint: "wrist".to_owned(),
                handedness: v1::Handedness::Left.into(),
            }],
            limits: vec![limits(v1::Digit::Ring), limits(v1::Digit::Thumb)],
            handedness: v1::Handedness::Right.into(),
            width_scale: Some(0.75),
            radii: [("wrist".to_owned(), 0.02)].into(),
            ..Default::default()
        };
        let joint = v1::JointPose::new(v1::Pose::new(Vec3::X, Quat::IDENTITY), 0.01);
        let of_joints = v1::CreateRigRequest {
            rig_id: "mine".to_owned(),
            joints: vec![
                v1::HandJoints::new(v1::Handedness::Left, [joint, v1::JointPose::default()]),
                v1::HandJoints::new(v1::Handedness::Right, [joint]),
            ],
            ..Default::default()
        };
        for request in [of_models, of_joints] {
            assert_eq!(read(&request.clone().into()), request);
        }
    }

    #[test]
    fn a_record_of_another_rig_is_found() {
        let bytes = SavedRig::default().encode_to_vec();
        assert_eq!(SavedRig::from_message("mine", &bytes), Err(Unreadable::Name));
    }

    #[test]
    fn limits_of_version_0_1_are_of_the_digit_of_their_place() {
        let saved = SavedRig {
            id: "mine".to_owned(),
            limits: vec![Limits::default(); 5],
            ..Default::default()
        };
        let digits = read(&saved).limits.into_iter().map(|limits| limits.digit());
        assert!(digits.eq(DIGITS));
    }
}
