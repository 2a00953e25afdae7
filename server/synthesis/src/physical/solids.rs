//! Hands as solids: what they leave free of objects and of each other.
//!
//! A hand is a union of tapered capsules ([`HandSolids`]; where it is beside another person's, [`ToldSolids`]). How far
//! it is from an object's surface, and how deep in it, is asked capsule by capsule ([`clearance()`], [`closest()`],
//! [`comes_within()`]); how far from other parts of itself by [`self_clearance`], and how far from a giver's hand, of that
//! hand when it is a [`PreparedHand`].

mod balls;
mod flesh;
mod hand_clearance;
mod hand_solids;
mod mesh_clearance;
mod prepared_hand;
mod told_palm;
mod told_solids;

pub use balls::{BALLS, Balls};
pub use flesh::{PALM_SOLIDS, THENAR_SOLIDS};
pub(super) use hand_clearance::Bounded;
pub use hand_clearance::{SOFT_CONTACT, self_clearance};
pub use hand_solids::{FOREARM_SOLIDS, HandSolids, link_radii, link_solids};
pub use mesh_clearance::{Touch, clearance, closest, comes_within};
pub use prepared_hand::PreparedHand;
pub use told_palm::ToldPalm;
pub use told_solids::{TOLD_SOLIDS, ToldSolids};

pub use crate::geometry::tapered_capsule::TaperedCapsule;
