//! Hands as solids, and their clearances from objects and from each other.
//!
//! A hand is a union of tapered capsules: [`HandSolids`], or [`TrackedSolids`] where it meets another person's hand.
//! [`clearance()`], [`closest()`] and [`comes_within()`] measure a capsule against an object's surface,
//! [`self_clearance`] a hand against itself, and [`PreparedHand`] a giver's hand against others.

mod flesh;
mod hand_clearance;
mod hand_solids;
mod mesh_clearance;
mod prepared_hand;
mod solid_part;
mod spheres;
mod tracked_palm;
mod tracked_solids;

pub use crate::physical::solids::flesh::PALM_SOLIDS;
pub(crate) use crate::physical::solids::flesh::THENAR_SOLIDS;
pub(crate) use crate::physical::solids::hand_clearance::NearestParts;
pub use crate::physical::solids::hand_clearance::{Bounded, SOFT_CONTACT, rest_overlaps, self_clearance};
pub(super) use crate::physical::solids::hand_solids::FOREARM_LENGTH;
pub(crate) use crate::physical::solids::hand_solids::{FOREARM_SOLIDS, link_radii};
pub use crate::physical::solids::hand_solids::{HandSolids, link_solids};
pub use crate::physical::solids::mesh_clearance::{Touch, clearance, closest, comes_within};
pub use crate::physical::solids::prepared_hand::PreparedHand;
pub use crate::physical::solids::solid_part::SolidPart;
pub use crate::physical::solids::spheres::{SPHERES, Spheres};
pub use crate::physical::solids::tracked_palm::TrackedPalm;
pub use crate::physical::solids::tracked_solids::{TRACKED_SOLIDS, TrackedSolids};

pub use crate::geometry::tapered_capsule::TaperedCapsule;
