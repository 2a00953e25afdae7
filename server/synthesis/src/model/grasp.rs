//! Grasps and their contacts, in the object's frame.

use glam::Vec3;

use super::{
    grasp_type::Classification,
    hand::{HandPart, HandPose},
    score::Score,
};

/// A point where the hand touches the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// On the surface, in metres.
    pub position: Vec3,
    /// The surface's outward unit normal; at an edge or a corner, under `PHYSICAL` validity, that of the directions
    /// between its faces' normals which points to the bone.
    pub normal: Vec3,
    /// The triangle that is touched.
    pub triangle: u32,
    /// What touches there.
    pub part: HandPart,
}

/// A valid grasp.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// The receiving hand in the object's frame.
    pub pose: HandPose,
    /// The bend ratio that each digit was closed with, thumb first; none where the digit found no contact.
    pub bend_ratios: [Option<f32>; 5],
    /// Where it touches, thumb first, the palm last.
    pub contacts: Vec<Contact>,
    /// The force that the hand applies on the object at each contact, in newtons.
    pub forces: Vec<Vec3>,
    /// The torsion of a soft finger at each contact, about the surface's inward normal, in newton metres; empty under the
    /// thesis' validity, which knows none.
    pub torsions: Vec<f32>,
    /// Angle between the summed contact wrench and the one that opposes gravity (Eq. 4.5), in radians.
    pub wrench_angle: f32,
    /// E of Eq. 4.6.
    pub comfort: f32,
    /// By how much the grasp passes the checks of `PHYSICAL` validity; none under the thesis' own.
    pub margins: Option<PhysicalMargins>,
    /// What it is in the taxonomy.
    pub classification: Classification,
    /// How good it is; none under the thesis' validity.
    pub score: Option<Score>,
    /// The way to it, once it was planned ([`crate::search::key_frames`]); none if there is no straight one.
    pub key_frames: Option<[KeyFrame; 3]>,
}

/// By how much a grasp passes the checks of `PHYSICAL` validity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhysicalMargins {
    /// Length of the wrench that the forces leave unbalanced, torque over the object's characteristic length, as a share
    /// of the weight.
    pub residual: f32,
    /// Ferrari-Canny epsilon of the contacts, torque over the characteristic length.
    pub epsilon: f32,
    /// How deep the hand sinks into the object at its deepest, in metres; 0 if it does nowhere.
    pub penetration: f32,
    /// Smallest distance between the receiving hand or forearm and the giver's, in metres; none without a giver.
    pub giver_clearance: Option<f32>,
}

/// A stage on the way to a grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// The open hand is away from the object.
    Approach,
    /// The open hand is around the object.
    PreGrasp,
    /// The grasp itself.
    Close,
}

/// The receiving hand at a stage on the way to a grasp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyFrame {
    /// The stage.
    pub stage: Stage,
    /// The hand in the object's frame.
    pub pose: HandPose,
}
