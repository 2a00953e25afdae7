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
    let parse = |message: &[u8]| {
        let saved = SavedRig::decode(message).map_err(|_| Unreadable::Message)?;
        let request = v1::CreateRigRequest::from(saved);
        if request.rig_id == id {
            Ok(request)
        } else {
            Err(Unreadable::Name)
        }
    };
    rigs.read(id, parse).await
}

/// What a client sent to create a rig. Version 0.1 wrote the fields before the request, which are read, but not written.
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
    #[prost(message, optional, tag = "10")]
    request: Option<v1::CreateRigRequest>,
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

impl From<v1::CreateRigRequest> for SavedRig {
    fn from(request: v1::CreateRigRequest) -> Self {
        Self {
            request: Some(request),
            ..Self::default()
        }
    }
}

impl From<SavedRig> for v1::CreateRigRequest {
    fn from(saved: SavedRig) -> Self {
        if let Some(request) = saved.request {
            return request;
        }
        let models = [saved.model, saved.other_model];
        let hands = saved.joints.into_iter().flat_map(|joints| joints.hands);
        let limits = saved.limits.into_iter().enumerate();
        Self {
            rig_id: saved.id,
            models: models.into_iter().filter(|model| !model.is_empty()).collect(),
            joints: hands
                .map(|hand| v1::HandJoints::new(hand.side(), hand.joints))
                .collect(),
            joint_map: saved.joint_map,
            limits: limits.map(|(place, limits)| limits.of_digit_at(place)).collect(),
            handedness: saved.side,
            width_scale: Some(saved.width_scale).filter(|scale| *scale != 0.0),
            radii: saved.radii,
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
    use super::*;

    #[test]
    fn limits_of_version_0_1_are_of_the_digit_of_their_place() {
        let saved = SavedRig {
            limits: vec![Limits::default(); 5],
            ..Default::default()
        };
        let request = v1::CreateRigRequest::from(saved);
        let digits = request.limits.into_iter().map(|limits| limits.digit());
        assert!(digits.eq(DIGITS));
    }
}
