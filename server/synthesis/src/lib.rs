//! Grasp synthesis for human-virtual character handovers, after Eva Linssen's thesis of that name (chapters 4 and 5).
//!
//! The crate is pure: no I/O, no async, and no clock but the one the caller supplies. All computation happens in the
//! object's frame, so the object's search structures are built once.
//!
//! Conventions: right-handed, metres, kilograms, newtons, radians, unit quaternions; `a_from_b` maps points of frame
//! b to frame a. Hand frames follow the thesis (4.4): +y along the fingers, +z out of the palm, pitch about x, yaw
//! about z; only [`model::hand::joints`] converts between them and `OpenXR` joint frames.
//!
//! The modules are layers. Each imports only from layers above it in this table; `tests/run` checks that.
//!
//! | Layer | Contents |
//! |---|---|
//! | [`base`] | poses, the clock, random streams, the stopwatch, rejections |
//! | [`geometry`] | meshes, their BVH, closest points, winding numbers, boxes, capsules |
//! | [`model`] | hand rig and kinematics, object, holdout, contact, grasp, score, strategy, requirements |
//! | [`thesis`], [`physical`] | Algorithm 1 with strategies A to F; `PHYSICAL` validity. Neither imports the other |
//! | [`rating`] | score terms, taxonomy, comfort, stiffness |
//! | [`propose`] | hand placement: opposition, surface pairs, the success prior, the placement cache |
//! | [`known`] | the atlas: entries, growth, look-up; grips transferred from primitives; seeds |
//! | [`search`] | dispatch of an attempt, the race, the report, key frames; verdicts about hands, ratings of holdouts |

pub mod base;
pub mod geometry;
pub mod known;
pub mod model;
pub mod physical;
pub mod propose;
pub mod rating;
pub mod search;
pub mod thesis;
