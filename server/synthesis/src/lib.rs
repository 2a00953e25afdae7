//! Grasp synthesis for human-virtual character handovers, after Eva Linssen's thesis of that name (chapters 4 and 5).
//!
//! The crate is pure: no I/O, no async, no clock but the one handed in. Everything is computed in the object's frame,
//! so that the object's search structures are built once.
//!
//! Conventions: right-handed, metres, kilograms, newtons, radians, unit quaternions; `a_from_b` takes points of
//! frame b to frame a. Hand frames follow the thesis (4.4): +y along the fingers, +z out of the palm, pitch about x,
//! yaw about z; [`model::hand::joints`] is the one place where they become `OpenXR` joint frames.
//!
//! The modules are layers. Each knows only those above it in this table; a test refuses any other import.
//!
//! | Layer | What it holds |
//! |---|---|
//! | [`base`] | poses, the clock, random streams, the stopwatch, rejections |
//! | [`geometry`] | meshes, their BVH, closest points, winding numbers, boxes, capsules |
//! | [`model`] | hand rig and kinematics, object, holdout, contact, grasp, constraints |
//! | [`thesis`], [`physical`] | Algorithm 1 with strategies A to F; `PHYSICAL` validity. Neither knows the other |
//! | [`rating`] | score, taxonomy, comfort |
//! | [`propose`] | where hands are placed: opposition, surface pairs, the success prior, the placement cache |
//! | [`known`] | the atlas: entries, growth, look-up; grips transferred from primitives; seeds |
//! | [`search`] | one attempt's dispatch, the race, the report, key frames |

pub mod base;
pub mod geometry;
pub mod known;
pub mod model;
pub mod physical;
pub mod propose;
pub mod rating;
pub mod search;
pub mod thesis;
