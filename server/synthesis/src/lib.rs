//! Grasp synthesis for human-virtual character handovers, after Eva Linssen's thesis of that name (chapters 4 and 5).
//!
//! The crate is pure: no I/O, no async, no clock but the one handed in. Everything is computed in the object's frame,
//! so that the object's search structures are built once and used as they are.
//!
//! Conventions: right-handed, metres, kilograms, newtons, radians, unit quaternions; `a_from_b` takes points of
//! frame b to frame a. Hand frames follow the thesis (4.4): +y along the fingers, +z out of the palm, pitch about x,
//! yaw about z; [`hand::joints`] is the one place where they become `OpenXR` joint frames.

pub mod atlas;
pub mod clock;
pub mod constraints;
pub mod geometry;
pub mod grasp;
pub mod guided;
pub mod hand;
pub mod holdout;
pub mod key_frames;
pub mod object;
pub mod physical;
pub mod pose;
pub mod primitives;
pub mod rejection;
pub mod score;
pub mod search;
pub mod strategy;
pub mod synthesis;
pub mod taxonomy;
