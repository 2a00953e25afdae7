//! Immobility: contact forces that hold the object, and closure.
//!
//! A wrench is six dimensionless numbers: force, and torque about the middle of the contacts divided by half their span,
//! so that units do not weight one against the other (the thesis mixes newtons and newton metres, Eq. 4.5), and so that
//! parts of the object that are far from the hand change nothing. Contacts are soft fingers with exact, curved friction limits. Both solvers query those limits
//! only for the wrench that reaches farthest in a direction; whatever they build lies inside the true limits, so
//! every answer is conservative.
//!
//! - [`balance()`]: forces that hold the object against gravity, as comfortably as possible (non-negative least squares
//!   after Lawson and Hanson, over cones instead of a matrix);
//! - [`epsilon`]: the largest disturbance that the contacts resist in every direction (Ferrari and Canny), by an
//!   expanding polytope in six dimensions.

mod balance;
mod closure;
mod contact_model;
mod least_squares;
mod polytope;

use glam::Vec3;

use super::solids::PALM_SOLIDS;
use crate::model::hand::Digit;
pub use crate::physical::immobility::balance::{BALANCE_TOLERANCE, MAX_CONTACT_FORCE, balance, balance_with};
pub(crate) use crate::physical::immobility::balance::{firm_force, nearest_balance};
pub use crate::physical::immobility::closure::{EPSILON_TOLERANCE, epsilon, epsilon_upper_bound};

/// Upper bound on the contacts of a hand: one per link of a digit and one per solid of the palm.
pub const MAX_CONTACTS: usize = 15 + PALM_SOLIDS;

/// Range of the length that torques are divided by, in metres: half the width of a fingertip pinch, and half a hand's
/// breadth with the thumb. Shorter ones demand more resistance to twist of contacts that are close together.
pub const HAND_LENGTHS: [f32; 2] = [0.02, 0.06];

/// A soft-finger contact: it pushes, resists sliding along the surface, and resists twist about the normal.
///
/// With normal force N, tangential force T and torsion M, it holds while (T / μN)² + (M / ρN)² ≤ 1: the elliptical
/// limit surface of Howe and Cutkosky (1996), which lies inside Coulomb's cone of half-angle tan⁻¹ μ and inside the
/// limit of pure torsion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftContact {
    /// On the surface, in the object's frame.
    pub position: Vec3,
    /// Outward unit normal of the object.
    pub normal: Vec3,
    /// The touching digit; `None` for the palm.
    pub digit: Option<Digit>,
    /// μ: coefficient of static friction, positive.
    pub friction: f32,
    /// ρ in metres, non-negative: largest torsion about the normal per newton of normal force. 0 is a point contact.
    pub torsion_radius: f32,
}

/// What torques are measured by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueScale {
    /// The point that torques are about, in metres, in the object's frame.
    pub centre: Vec3,
    /// The divisor of torques, in metres, positive. Larger values weight twist less against force.
    pub length: f32,
}

impl TorqueScale {
    /// The middle of the contacts and half their span, within [`HAND_LENGTHS`].
    pub fn of(contacts: &[SoftContact]) -> Self {
        let positions = contacts.iter().map(|contact| contact.position);
        let mut squared_span = 0.0_f32;
        for (i, a) in contacts.iter().enumerate() {
            for b in &contacts[..i] {
                squared_span = squared_span.max(a.position.distance_squared(b.position));
            }
        }
        let [shortest, longest] = HAND_LENGTHS;
        Self {
            centre: positions.sum::<Vec3>() / contacts.len().max(1) as f32,
            length: (0.5 * squared_span.sqrt()).clamp(shortest, longest),
        }
    }
}

/// The load on the contacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// In kilograms, positive.
    pub mass: f32,
    /// In metres, in the object's frame.
    pub centre_of_mass: Vec3,
    /// Unit vector against gravity, in the object's frame.
    pub up: Vec3,
    /// What torques are measured by.
    pub torque_scale: TorqueScale,
}

/// Contact forces that balance gravity, one entry per contact.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Balance {
    /// Forces of the hand on the object, in newtons, in the object's frame.
    pub forces: Vec<Vec3>,
    /// Torsions about the inward normals, in newton metres.
    pub torsions: Vec<f32>,
    /// Length of the unbalanced wrench (torque over [`TorqueScale::length`]) as a share of the weight.
    pub residual: f32,
    /// The friction limits the forces respect.
    pub friction_use: FrictionUse,
}

/// How much of friction and torsion the forces may use. [`balance()`] tries these in order until the digits press
/// firmly. More steps would find safer forces, but cost time whenever the first fail.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum FrictionUse {
    /// Less than half, so that twice the load holds too.
    #[default]
    Low,
    /// Most of it.
    Moderate,
    /// All of it.
    Full,
}

impl FrictionUse {
    /// All of them, safest first.
    pub const ALL: [Self; 3] = [Self::Low, Self::Moderate, Self::Full];
}

/// Buffers that [`balance()`] and [`epsilon`] reuse between calls.
#[derive(Clone, Debug, Default)]
pub struct Buffers {
    cones: Vec<contact_model::ContactCone>,
    solvers: balance::Solvers,
    polytope: polytope::Polytope,
}
