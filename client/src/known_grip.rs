//! Grips on an object that its owner knows.

use serde::{Deserialize, Serialize};

use crate::{
    hand::{DigitAngles, Handedness},
    pose::Pose,
    query::Convention,
};

/// What becomes of a known grip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KnownGripUse {
    /// It is tried before all others, and answered if it passes every check.
    Preferred,
    /// Neither it nor a grasp near it is answered.
    Banned,
}

/// A grip on an object, of one hand of a rig.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownGrip {
    /// Distinguishes it from the object's other grips: 1 to 63 characters.
    pub name: String,
    /// What becomes of it.
    #[serde(rename = "use")]
    pub used: KnownGripUse,
    /// The rig of a preferred grip: "thesis", "adult", or "rigs/{rig}". Banned ones count for every rig.
    #[serde(default)]
    pub rig: String,
    /// The hand; the other one may take the object in the same way.
    pub handedness: Handedness,
    /// How many times as large as its rig the hand of a preferred grip is, from 0.5 to 2; none: 1.
    #[serde(default)]
    pub hand_scale: Option<f32>,
    /// The wrist's joint frame in the object's frame, as in an answer.
    pub object_from_wrist: Pose,
    /// The convention of that answer.
    #[serde(default)]
    pub convention: Convention,
    /// Joint angles of a preferred grip, thumb first; none for a banned one.
    #[serde(default)]
    pub digits: Option<[DigitAngles; 5]>,
    /// For a banned grip: wrists closer than this, in metres, are near; more than 0, at most 1; none: 0.03.
    #[serde(default)]
    pub near_metres: Option<f32>,
    /// For a banned grip: and turned by less than this, in radians; more than 0, at most 3.2; none: 0.5.
    #[serde(default)]
    pub near_radians: Option<f32>,
}

impl KnownGrip {
    /// A grip to try first, of the rig `adult`.
    pub fn preferred(
        name: impl Into<String>,
        handedness: Handedness,
        object_from_wrist: Pose,
        digits: [DigitAngles; 5],
    ) -> Self {
        Self {
            rig: "adult".to_owned(),
            digits: Some(digits),
            used: KnownGripUse::Preferred,
            ..Self::banned(name, handedness, object_from_wrist)
        }
    }

    /// A grip not to answer.
    pub fn banned(name: impl Into<String>, handedness: Handedness, object_from_wrist: Pose) -> Self {
        Self {
            name: name.into(),
            used: KnownGripUse::Banned,
            rig: String::new(),
            handedness,
            hand_scale: None,
            object_from_wrist,
            convention: Convention::OpenXr,
            digits: None,
            near_metres: None,
            near_radians: None,
        }
    }
}
