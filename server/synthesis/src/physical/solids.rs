//! Hands as solids, and their clearances from objects and from each other.
//!
//! A hand is a union of tapered capsules: [`HandSolids`], or [`TrackedSolids`] where it meets another person's hand.
//! [`clearance()`], [`closest()`] and [`comes_within()`] measure a capsule against an object's surface,
//! [`self_clearance`] a hand against itself, and [`PreparedHand`] a giver's hand against others.

mod clearance;
mod flesh;
mod hand_solids;
mod prepared_hand;

pub(super) use self::hand_solids::FOREARM_LENGTH;
pub(crate) use self::{
    clearance::NearestParts,
    flesh::THENAR_SOLIDS,
    hand_solids::{FOREARM_SOLIDS, link_radii},
};
pub use self::{
    clearance::{Bounded, SOFT_CONTACT, clearance, closest, comes_within, rest_overlaps, self_clearance},
    flesh::{PALM_SOLIDS, TrackedPalm},
    hand_solids::{HandSolids, SolidPart, TRACKED_SOLIDS, TrackedSolids, link_solids},
    prepared_hand::{PreparedHand, SPHERES, Spheres},
};

pub use crate::geometry::tapered_capsule::TaperedCapsule;
