//! Proposals of `GUIDED` search: hands placed where grasps are likely, instead of anywhere near the object.
//!
//! Hands hold between thumb and finger pads, or in the palm. [`opposition`] samples hand shapes whose pads oppose each other at
//! known widths; [`surface_pairs`] samples opposed points of the object with its thickness there; [`proposal`] matches the two
//! and prefers hands that are likely to hold ([`success_prior`]). Whether a hand fits at the object does not depend on the giver,
//! so the first attempts choose from placements sampled once ([`prepared`]).
//!
//! Heavy things with a handle are wrapped there with the whole hand instead ([`handles`]), and what hangs is taken by hooked
//! fingers ([`handles`]). What takes two hands is held on both sides of its centre of mass ([`both_hands`]), mostly by mirror
//! images of one hand.
//!
//! Proposals pass no check here; a hand that nearly passes them is perturbed a few times (`hold_or_refine`).

pub mod both_hands;
pub mod handles;
pub mod opposition;
pub mod prepared;
pub mod proposal;
pub mod success_prior;
pub mod surface_pairs;
