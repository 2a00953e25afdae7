//! `GUIDED` search: hands are placed where grips are, instead of anywhere.
//!
//! A proposal starts from how hands hold: between thumb and finger pads, or in the palm. The hand's side
//! ([`opposition`]) draws a shape and asks where its pads oppose each other and how far apart; the object's side
//! ([`surface_pairs`]) knows where it is as thick as that; [`proposal`] puts the two together, and prefers what is likely to
//! hold ([`success_prior`]). Where a hand has room at an object does not hang on who presents it: the first attempts choose from
//! what was drawn once ([`placement_cache`]). What comes of a proposal is decided by the same checks as ever; a hand that nearly
//! passes them is moved on a little, and a little again (`PhysicalAttempt::hold_or_refine`).

pub mod opposition;
pub mod placement_cache;
pub mod prepared;
pub mod proposal;
pub mod success_prior;
pub mod surface_pairs;
