//! Known grips: hands that can hold an object, found before anyone holds it out.
//!
//! A grip that passes every check on object and hand alone is valid for every holdout whose giver and gravity allow it. So grips
//! are collected once per object and rig ([`growth`]) into an [`atlas`]; a request checks only the giver's hand and the forces
//! ([`recheck`]). The thesis rejects precomputed grasps because a giver may obstruct all of them (section 1). Hence the atlas never
//! answers alone: a fresh search runs in parallel. Its grasps are learned and tried after all other known grips; reproducible
//! answers ignore them.
//!
//! If no known grip is valid as it is, attempts perturb hands near known ones ([`seeds`]), for an object without an atlas near
//! those of similar boxes ([`primitives`]). Hands that its owner posed follow a resized surface ([`moved_grips`]).

pub mod atlas;
pub mod codec;
pub mod entry;
mod excerpt;
pub mod finger_subsets;
pub mod growth;
pub mod moved_grips;
pub mod primitives;
pub mod recheck;
pub mod seeds;
mod spread;
