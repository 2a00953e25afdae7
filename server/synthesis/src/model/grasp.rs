//! Grasps, their contacts and constants of their forces, in the object's frame.

use glam::Vec3;

use super::{
    grasp_type::Classification,
    hand::{HandPart, HandPose},
    holdout::ArmPose,
    score::Score,
};

/// A point where the hand touches the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The point on the object's surface, in metres.
    pub position: Vec3,
    /// The surface's outward unit normal. Under `PHYSICAL` validity, a contact at an edge or a corner takes the
    /// direction to the bone, within the range of the adjacent faces' normals.
    pub normal: Vec3,
    /// The touched triangle.
    pub triangle: u32,
    /// The part of the hand that touches.
    pub part: HandPart,
}

/// A valid grasp.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// The receiving hand in the object's frame.
    pub pose: HandPose,
    /// The bend ratio with which each digit closed, thumb first; `None` for a digit without contact.
    pub bend_ratios: [Option<f32>; 5],
    /// The contacts, thumb first, palm last.
    pub contacts: Vec<Contact>,
    /// The force that the hand exerts on the object at each contact, in newtons.
    pub forces: Vec<Vec3>,
    /// The soft-finger torsion at each contact about the surface's inward normal, in newton metres; empty under
    /// `THESIS` validity, which has none.
    pub torsions: Vec<f32>,
    /// Angle between the total contact wrench and the wrench that opposes gravity (Eq. 4.5), in radians.
    pub wrench_angle: f32,
    /// The comfort cost E of Eq. 4.6; 0 is best.
    pub comfort: f32,
    /// The margins of the `PHYSICAL` validity checks; `None` under `THESIS` validity.
    pub margins: Option<PhysicalMargins>,
    /// The grasp type in the taxonomy.
    pub classification: Classification,
    /// True if the load hangs in hooked fingers. Closure was then not required, and the forces are those of the load at
    /// rest, with its centre of mass below the fingers.
    pub hangs: bool,
    /// The score; `None` under `THESIS` validity.
    pub score: Option<Score>,
    /// The receiver's arm, if the receiver's place is given or can be assumed and the arm reaches from there.
    pub arm: Option<ArmPose>,
    /// The motion to the grasp, once planned ([`crate::search::key_frames`]); `None` before that, or if no straight
    /// path exists.
    pub key_frames: Option<[KeyFrame; 3]>,
    /// The second hand of a two-handed grasp. The forces of both balance the weight, and residual, epsilon and wrench angle of
    /// both grasps are those of all contacts together.
    pub other_hand: Option<Box<Grasp>>,
}

/// The margins by which a grasp passes the checks of `PHYSICAL` validity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhysicalMargins {
    /// Magnitude of the unbalanced wrench, as a share of the weight; torques about the middle of the contacts are divided
    /// by half their span.
    pub residual: f32,
    /// Ferrari-Canny epsilon of the contacts, with torques scaled in the same way.
    pub epsilon: f32,
    /// Deepest penetration of the hand into the object, in metres; 0 without any.
    pub penetration: f32,
    /// Smallest distance between the receiver's hand or forearm and the holdout's hands, in metres; `None` without any.
    pub giver_clearance: Option<f32>,
    /// Smallest distance between the receiver's hand or forearm and the obstacles, in metres; `None` without any.
    pub obstacle_clearance: Option<f32>,
}

/// A stage of the motion to a grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// The open hand away from the object.
    Approach,
    /// The open hand around the object.
    PreGrasp,
    /// The grasp itself.
    Close,
}

/// The receiving hand at one stage of the motion to a grasp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyFrame {
    /// The stage.
    pub stage: Stage,
    /// The hand in the object's frame.
    pub pose: HandPose,
}

/// Gravitational acceleration, in m/s² (thesis 2.6).
pub const GRAVITY: f32 = 9.81;

/// D: the shares of the total force that the digits apply comfortably, thumb first; they sum to one (thesis 2.5,
/// after Radwin et al.).
pub const COMFORTABLE_SHARES: [f32; 5] = [0.25, 0.25, 0.25, 0.125, 0.125];
