//! What is kept of a grasp or a failed attempt.

use std::fmt;

use grasp_synthesis::{
    base::rejection::Rejection, search::GraspSource, thesis::placement_measures::PlacementMeasures,
};
use serde::{Deserialize, Serialize};

use crate::plan::Cell;

/// One attempt: the last one of a search, valid, or one of those that failed. Or the grip of an atlas that ended a
/// search, or that a search gave up.
///
/// Set, holdout, seed and attempt make an attempt again:
/// `grasp find --holdout H --validity V --strategy S --bend-ratios R --seed N --only-attempt I`. A grip of an atlas is
/// what a server whose atlas is complete answers to `grasp find --holdout H --reproducible`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Where it belongs.
    #[serde(flatten)]
    pub cell: Cell,
    /// Counts the valid ones of the cell, and the invalid ones for themselves, from 0.
    pub number: u64,
    /// The seed of its search.
    pub seed: u64,
    /// Which attempt of the seed it is, or which grip.
    #[serde(flatten)]
    pub source: Source,
    /// Why it failed; none if it is valid, or if a search gave up.
    pub rejection: Option<Rejection>,
    /// What the search took that ended with it; none for a failed attempt.
    pub search: Option<SearchFigures>,
    /// Its details; none of searches on more than one thread, which are made for their times, or that gave up.
    pub details: Option<Details>,
}

/// Where a record's hand came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// An attempt of this index.
    Attempt(u64),
    /// The grip of this index of the object's complete atlas.
    AtlasEntry(u16),
    /// There is none: the search gave up.
    Nowhere,
}

impl Source {
    /// Where a grasp came from; none if it was known from an earlier search, which experiments do not let happen.
    pub fn of(source: GraspSource) -> Option<Self> {
        match source {
            GraspSource::Attempt(index) => Some(Self::Attempt(index)),
            GraspSource::Atlas(entry) | GraspSource::Spared(entry) => Some(Self::AtlasEntry(entry)),
            GraspSource::Recent => None,
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

/// What it took to find a valid grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SearchFigures {
    /// Attempts, the valid one included: accepted placements, as the thesis counts. None where a grip of an atlas was
    /// found first.
    pub attempts: u64,
    /// Placements that the measures pruned.
    pub pruned_placements: u64,
    /// Failed attempts by kind, in the order of [`Rejection::OF_THESIS`]: the experiments set no constraints.
    pub rejections: [u64; 8],
    /// Wall-clock time in nanoseconds.
    pub nanoseconds: u64,
    /// Of a set with an atlas.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub atlas: Option<AtlasFigures>,
}

/// What a search that may answer from an atlas reports of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AtlasFigures {
    /// Grips that there were to try.
    pub entries: u64,
    /// Valid grasps that were found by the end.
    pub candidates: u64,
}

/// What an attempt was like.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Details {
    /// Of its wrist placement; under `PHYSICAL` validity that of a valid grasp is where the wrist came to be. None of an
    /// attempt at which guided search found no place.
    pub measures: Option<Measures>,
    /// The digits that were posed, thumb first; none of failed attempts under `PHYSICAL` validity, where what the digits
    /// touch is not known.
    pub digits: Vec<DigitFigures>,
    /// Median time of each step in nanoseconds over some replays, in the order of [`STEP_NAMES`]; none of a grip of an
    /// atlas, which takes no steps.
    pub step_nanoseconds: Option<[u64; 5]>,
    /// Of a valid grasp.
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
    /// With which it touches; none if it does not.
    pub bend_ratio: Option<f32>,
    /// Links that touch.
    pub contacts: u32,
    /// If it touches as in the thesis: does it also with 0.7, 1 and 1.42 alone, at the same wrist and yaw (Figure 5.19)?
    pub touches_with: Option<[bool; 3]>,
}

/// What only a valid grasp has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GraspFigures {
    /// Angle of Eq. 4.5.
    pub wrench_angle_degrees: f32,
    /// E of Eq. 4.6.
    pub comfort: f32,
    /// How many of 100 further random force distributions oppose gravity (5.6); none under `PHYSICAL` validity, where
    /// forces are solved for and not drawn.
    pub sufficient_distributions: Option<u32>,
    /// E again for the same contacts, each from force distributions drawn anew. Empty if none sufficed, or if none are
    /// drawn.
    pub comfort_again: Vec<f32>,
    /// Contacts of the palm, which there are under `PHYSICAL` validity only.
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

    /// The details, of which every record on one thread has some.
    pub fn grasp(&self) -> Option<&GraspFigures> {
        self.details.as_ref()?.grasp.as_ref()
    }
}

/// The name of an output type as Table 5.2 has it, or would.
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
        Some(Rejection::UnmetConstraint) => "UnmetConstraint",
        None => "Valid",
    }
}
