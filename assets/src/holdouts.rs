//! The 15 built-in holdouts, named as in the thesis (Figures 5.2 to 5.4).
//!
//! Each is one JSON file under `holdouts/`, written by `grasp-assets-generator`, with the fields of [`BuiltInHoldout`].
//! Lengths are in metres, angles in radians, quaternions in the order x y z w, and transforms read `a_from_b`:
//!
//! ```json
//! {
//!   "name": "scalpel-genhold3",
//!   "object": "scalpel",
//!   "grasp_type": "Palmar Pinch",
//!   "origin": { "synthesized": { "seed": 1, "attempt": 2, "strategy": "F", "bend_ratios": "one_random",
//!                                "friction": 0.34, "up": [0.0, 1.0, 0.0] } },
//!   "world_from_object": { "position": [0.0, 0.0, 0.0], "orientation": [0.0, 0.0, 0.0, 1.0] },
//!   "giver_rig": "thesis",
//!   "giver_handedness": "right",
//!   "world_from_giver_wrist": { "position": [0.0, 0.0, -0.1], "orientation": [0.0, 0.0, 0.0, 1.0] },
//!   "giver_digits": [ { "base_yaw": 0.0, "base_pitch": 0.0, "second_pitch": 0.0, "third_pitch": 0.0 }, … ]
//! }
//! ```
//!
//! `origin` is `"manual"` for the Holds. Digits run from the thumb to the little finger.

use std::sync::LazyLock;

use glam::Vec3;
use grasp_synthesis::{
    base::pose::Pose,
    model::{
        hand::{DigitAngles, HandPose, Handedness, joints::HandJoints},
        holdout::{Holdout, PresentingHand, PresentingHandError, Stance},
        strategy::{BendRatioChoice, Strategy},
    },
    propose::prepared::PreparedObject,
};
use serde::{Deserialize, Serialize};

use crate::{hands, objects};

/// How a holdout was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// Posed by hand after a real-world hold.
    Manual,
    /// Found by the project's own synthesis on the free object, with the giver's rig: the result of attempt `attempt` of
    /// this search.
    Synthesized {
        /// The seed of the search.
        seed: u64,
        /// The index of its attempt.
        attempt: u64,
        /// The step of the ladder.
        strategy: Strategy,
        /// The bend ratios that each digit tried.
        bend_ratios: BendRatioChoice,
        /// Coefficient of static friction.
        friction: f32,
        /// Unit vector against gravity, in the object's frame.
        up: Vec3,
    },
}

/// An object held out by a giver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BuiltInHoldout {
    /// "remote-genhold1" and so on: object, a hyphen, the thesis' name in lower case.
    pub name: String,
    /// Name of the object.
    pub object: String,
    /// The giver's grasp type in the taxonomy of Feix et al., as the thesis' captions classify it.
    pub grasp_type: String,
    /// How it was made.
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

/// Why a holdout cannot be prepared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HoldoutError {
    /// The object is not a built-in one.
    #[error("object {0:?} does not exist")]
    UnknownObject(String),
    /// The giver's rig is not a built-in one.
    #[error("giver_rig {0:?} does not exist; the rigs are {known:?}", known = hands::RIG_NAMES)]
    UnknownRig(String),
    /// The giver's pose collapses the skin.
    #[error(transparent)]
    PresentingHand(#[from] PresentingHandError),
}

impl BuiltInHoldout {
    /// The giver's hand in the world.
    pub fn giver_pose(&self) -> HandPose {
        HandPose {
            frame_from_wrist: self.world_from_giver_wrist,
            digits: self.giver_digits,
        }
    }

    /// The object, with the data that proposals derive from it.
    ///
    /// # Panics
    /// The holdout names an object that is not built in; none of [`holdouts`] does.
    pub fn prepared_object(&self) -> &'static PreparedObject {
        let object = objects::object(&self.object).expect("built-in holdouts name built-in objects");
        &object.prepared
    }

    /// The holdout in the object's frame, ready for a search.
    ///
    /// # Errors
    /// The object or the rig is not built in, or the giver's pose collapses the skin. Never happens for [`holdouts`].
    pub fn to_holdout(&self) -> Result<Holdout, HoldoutError> {
        let built_in =
            objects::object(&self.object).ok_or_else(|| HoldoutError::UnknownObject(self.object.clone()))?;
        let hand = hands::hand(&self.giver_rig, self.giver_handedness)
            .ok_or_else(|| HoldoutError::UnknownRig(self.giver_rig.clone()))?;
        let object_from_world = self.world_from_object.inverse();
        let joints_in_world = HandJoints::of_pose(&hand.rig, &self.giver_pose());
        Ok(Holdout {
            object: built_in.object.clone(),
            presenting_hand: Some(PresentingHand::in_frame(
                &hand.skin,
                &joints_in_world,
                object_from_world,
            )?),
            other_hands: Vec::new(),
            obstacles: Vec::new(),
            stance: Stance::default(),
            up: object_from_world.transform_vector(Vec3::Y),
        })
    }
}

/// The files, by object and then by name.
const FILES: [&str; 15] = [
    include_str!("../holdouts/remote-genhold1.json"),
    include_str!("../holdouts/remote-genhold2.json"),
    include_str!("../holdouts/remote-genhold3.json"),
    include_str!("../holdouts/remote-hold1.json"),
    include_str!("../holdouts/remote-hold2.json"),
    include_str!("../holdouts/scalpel-genhold1.json"),
    include_str!("../holdouts/scalpel-genhold2.json"),
    include_str!("../holdouts/scalpel-genhold3.json"),
    include_str!("../holdouts/scalpel-hold1.json"),
    include_str!("../holdouts/scalpel-hold2.json"),
    include_str!("../holdouts/scissors-genhold1.json"),
    include_str!("../holdouts/scissors-genhold2.json"),
    include_str!("../holdouts/scissors-genhold3.json"),
    include_str!("../holdouts/scissors-hold1.json"),
    include_str!("../holdouts/scissors-hold2.json"),
];

/// All built-in holdouts, by object and then by name; parsed on first use.
pub fn holdouts() -> &'static [BuiltInHoldout] {
    static HOLDOUTS: LazyLock<Vec<BuiltInHoldout>> = LazyLock::new(|| {
        FILES
            .iter()
            .map(|text| serde_json::from_str(text).expect("the embedded holdouts are valid"))
            .collect()
    });
    &HOLDOUTS
}

/// A built-in holdout by name.
pub fn holdout(name: &str) -> Option<&'static BuiltInHoldout> {
    holdouts().iter().find(|holdout| holdout.name == name)
}
