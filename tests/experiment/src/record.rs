//! Records of grasps and failed attempts.

use std::fmt;

use grasp_synthesis::{
    base::rejection::Rejection, search::GraspSource, thesis::placement_measures::PlacementMeasures,
};
use serde::{Deserialize, Serialize};

use crate::plan::Cell;

/// The valid attempt or the grip of an atlas that ended a search, a search that gave up, or a failed attempt.
///
/// Set, holdout, seed and attempt reproduce an attempt: `grasp find --holdout H --validity V --strategy S --bend-ratios R
/// --seed N --replay-attempt I --receiving-hand right`. With a complete atlas, a server answers `grasp find --holdout H
/// --receiving-hand right --reproducible` with the same grip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Its cell.
    #[serde(flatten)]
    pub cell: Cell,
    /// Number from 0 among the cell's valid or invalid records.
    pub number: u64,
    /// The seed of its search.
    pub seed: u64,
    /// The attempt of the seed, or the grip.
    #[serde(flatten)]
    pub source: Source,
    /// Why it failed; none if it is valid or the search gave up.
    pub rejection: Option<Rejection>,
    /// Effort of its search; none for a failed attempt.
    pub search: Option<SearchFigures>,
    /// Its details; none for searches on more than one thread, which serve for times only, or that gave up.
    pub details: Option<Details>,
}

/// Source of a record's hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// An attempt of this index.
    Attempt(u64),
    /// The grip of this index of the object's complete atlas.
    AtlasEntry(u16),
    /// None: the search gave up.
    Nowhere,
}

impl Source {
    /// The source of a grasp; none for preferred and current ones, which experiments do not use.
    pub fn of(source: GraspSource) -> Option<Self> {
        match source {
            GraspSource::Attempt(index) => Some(Self::Attempt(index)),
            GraspSource::Atlas(entry) => Some(Self::AtlasEntry(entry)),
            GraspSource::Learned(_) | GraspSource::Current | GraspSource::Preferred(_) => None,
        }
    }

    /// The index of an attempt.
    pub fn attempt(self) -> Option<u64> {
        match self {
            Self::Attempt(index) => Some(index),
            Self::AtlasEntry(_) | Self::Nowhere => None,
        }
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Attempt(index) => write!(f, "attempt {index}"),
            Self::AtlasEntry(entry) => write!(f, "grip {entry} of the atlas"),
            Self::Nowhere => f.write_str("no hand"),
        }
    }
}

/// Effort of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SearchFigures {
    /// Attempts, the valid one included: accepted placements, as in the thesis; 0 if a grip of the atlas is the answer.
    pub attempts: u64,
    /// Placements pruned by the measures.
    pub pruned_placements: u64,
    /// Failed attempts by kind, in the order of [`Rejection::THESIS`]: the experiments set no requirements.
    pub rejections: [u64; 8],
    /// Wall-clock time in nanoseconds.
    pub nanoseconds: u64,
    /// Of a set with an atlas.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub atlas: Option<AtlasFigures>,
}

/// A search's report on its atlas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AtlasFigures {
    /// Grips to try.
    pub entries: u64,
    /// Valid grasps found.
    pub candidates: u64,
}

/// Details of an attempt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Details {
    /// Measures of its wrist placement, for valid physical grasps that of the final wrist; none where guided search
    /// found no place.
    pub measures: Option<Measures>,
    /// The posed digits, thumb first; none for failed attempts under `PHYSICAL` validity, whose contacts are unknown.
    pub digits: Vec<DigitFigures>,
    /// Median time of each step over some replays, in nanoseconds and the order of [`STEP_NAMES`]; none for grips of an
    /// atlas, which take no steps.
    pub step_nanoseconds: Option<[u64; 5]>,
    /// Figures of a valid grasp.
    pub grasp: Option<GraspFigures>,
}

/// The steps of Algorithm 1, as the thesis' figures name them.
pub const STEP_NAMES: [&str; 5] = [
    "Wrist Placement",
    "Finger Posing",
    "Collision Validation",
    "Contact Validation",
    "Immobility Validation",
];

/// The measures of a wrist placement (thesis 5.3), centimetres and degrees as there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// From the wrist to the object.
    pub wrist_distance_cm: f32,
    /// From the palm to the object.
    pub palm_distance_cm: f32,
    /// Upwards wrist angle.
    pub upward_degrees: f32,
    /// Forward wrist angle.
    pub forward_degrees: f32,
    /// Palm-CoM-palm angle; none where a palm is straight above or below the centre of mass.
    pub palm_com_palm_degrees: Option<f32>,
}

impl From<PlacementMeasures> for Measures {
    fn from(measures: PlacementMeasures) -> Self {
        Self {
            wrist_distance_cm: measures.wrist_distance * 100.0,
            palm_distance_cm: measures.palm_distance * 100.0,
            upward_degrees: measures.upward_angle_degrees,
            forward_degrees: measures.forward_angle_degrees,
            palm_com_palm_degrees: measures.palm_com_palm_angle_degrees,
        }
    }
}

/// A posed digit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DigitFigures {
    /// ψ1.
    pub yaw_degrees: f32,
    /// θ1: the bend angle.
    pub bend_degrees: f32,
    /// The ratio with which it touches, if it does.
    pub bend_ratio: Option<f32>,
    /// Links that touch.
    pub contacts: u32,
    /// For a touching digit under the thesis' validity: whether it touches with 0.7, 1 and 1.42 alone, at the same
    /// wrist and yaw (Figure 5.19).
    pub touches_with: Option<[bool; 3]>,
}

/// Figures that only valid grasps have.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GraspFigures {
    /// Angle of Eq. 4.5.
    pub wrench_angle_degrees: f32,
    /// E of Eq. 4.6.
    pub comfort: f32,
    /// How many of 100 further random force distributions oppose gravity (5.6); none under `PHYSICAL` validity, where
    /// forces are solved, not drawn.
    pub sufficient_distributions: Option<u32>,
    /// E for the same contacts with other draws of force distributions. Empty if none sufficed, or if none are drawn.
    pub comfort_again: Vec<f32>,
    /// Contacts of the palm, only under `PHYSICAL` validity.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub palm_contacts: u32,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_zero(count: &u32) -> bool {
    *count == 0
}

impl Record {
    /// True for a valid grasp.
    pub fn is_valid(&self) -> bool {
        self.rejection.is_none() && self.source != Source::Nowhere
    }

    /// Figures of a valid grasp, which every valid record on one thread has.
    pub fn grasp(&self) -> Option<&GraspFigures> {
        self.details.as_ref()?.grasp.as_ref()
    }
}

/// The name of an output type, in the style of Table 5.2.
pub fn output_type(rejection: Option<Rejection>) -> &'static str {
    match rejection {
        Some(Rejection::NoContacts) => "NoContacts",
        Some(Rejection::NoThumb) => "NoThumb",
        Some(Rejection::NoThumbEarlyStop) => "NoThumbEarlystop",
        Some(Rejection::NoFingers) => "NoFingers",
        Some(Rejection::PalmCollision) => "PalmCollision",
        Some(Rejection::FingerCollision) => "FingerCollision",
        Some(Rejection::UnwantedContact) => "UnwantedContact",
        Some(Rejection::NotImmobilizing) => "NotImmobilizing",
        Some(Rejection::UnmetRequirement) => "UnmetRequirement",
        None => "Valid",
    }
}
