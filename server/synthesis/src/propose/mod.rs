//! Proposals of `GUIDED` search: hands placed where grasps are likely, instead of anywhere near the object.
//!
//! [`opposition`] samples hand shapes whose pads oppose each other at known widths; [`surface_pairs`] samples opposed points of the
//! object with its thickness there; [`proposal`] matches the two and prefers hands that are likely to hold ([`success_prior`]), or
//! lays the palm on the object. The first attempts choose from placements sampled once ([`prepared`]). Heavy things are wrapped at
//! their handle or hooked ([`handles`]), and objects for two hands are mostly held by mirror images of one ([`both_hands`]).

pub mod both_hands;
pub mod handles;
pub mod opposition;
pub mod prepared;
pub mod proposal;
pub mod success_prior;
pub mod surface_pairs;
