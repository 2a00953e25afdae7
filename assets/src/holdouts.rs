//! The 15 built-in holdouts, named as in the thesis (Figures 5.2 to 5.4). To come; the interface is fixed.

use glam::Vec3;
use grasp_synthesis::{
    hand::{DigitAngles, HandPose, Handedness},
    holdout::{Holdout, PresentingHandError},
    pose::Pose,
};
use serde::{Deserialize, Serialize};

/// How a holdout came to be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// Posed by hand after a real-world hold.
    Manual,
    /// Found by the project's own synthesis.
    Synthesized {
        /// The seed of the search.
        seed: u64,
        /// The index of its attempt.
        attempt: u64,
    },
}

/// An object held out by a giver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BuiltInHoldout {
    /// "remote-genhold1" and so on: object, a hyphen, the thesis' name in lower case.
    pub name: String,
    /// Name of the object.
    pub object: String,
    /// The giver's grasp type in the taxonomy of Feix et al., as the thesis' captions classify it.
    pub grasp_type: String,
    /// How it came to be.
    pub origin: Origin,
    /// The object in the world: +Y up, metres. The giver stands at -Z and holds the object out toward +Z.
    pub world_from_object: Pose,
    /// The giver's rig.
    pub giver_rig: String,
    /// The giver's hand.
    pub giver_handedness: Handedness,
    /// The giver's wrist frame (thesis axes) in the world.
    pub world_from_giver_wrist: Pose,
    /// The giver's joint angles in radians, thumb first.
    pub giver_digits: [DigitAngles; 5],
}

impl BuiltInHoldout {
    /// The giver's hand in the world.
    pub fn giver_pose(&self) -> HandPose {
        HandPose {
            frame_from_wrist: self.world_from_giver_wrist,
            digits: self.giver_digits,
        }
    }

    /// The holdout in the object's frame, ready to be searched.
    ///
    /// # Errors
    /// The giver's pose collapses the skin.
    pub fn to_holdout(&self) -> Result<Holdout, PresentingHandError> {
        let _ = Vec3::Y;
        Err(PresentingHandError::Collapsed)
    }
}

/// All built-in holdouts, by object and then by name, parsed once.
pub fn holdouts() -> &'static [BuiltInHoldout] {
    &[]
}

/// A built-in holdout by name.
pub fn holdout(name: &str) -> Option<&'static BuiltInHoldout> {
    holdouts().iter().find(|holdout| holdout.name == name)
}
