//! Immobility: forces that hold the object, and closure.
//!
//! Wrenches here are vectors of six dimensionless numbers: force, and torque about the centre of mass divided by the
//! object's characteristic length, so that neither counts more because of its unit (the thesis sets newtons beside
//! newton metres, Eq. 4.5). Contacts are soft fingers with their exact, curved friction limits;
//! both questions ask those for the wrench that reaches farthest in a direction, and take only such wrenches. What they
//! build from them lies inside the true limits, so that every answer is on the safe side.
//!
//! - [`balance`]: which forces hold the object against gravity, as comfortably as they can
//!   (non-negative least squares after Lawson and Hanson, over cones instead of a matrix);
//! - [`epsilon`]: how large a disturbance in any direction the contacts can resist (Ferrari and Canny), by an expanding
//!   polytope in six dimensions.

mod balance;
mod closure;
mod contact_model;
mod least_squares;
mod polytope;

use glam::Vec3;

use super::solids::PALM_SOLIDS;
use crate::model::hand::Digit;
pub(crate) use crate::physical::immobility::balance::firm_force;
pub use crate::physical::immobility::balance::{BALANCE_TOLERANCE, MAX_CONTACT_FORCE, balance, balance_with};
pub use crate::physical::immobility::closure::{EPSILON_TOLERANCE, epsilon, epsilon_upper_bound};

/// Contacts of a hand at most: one a link of each digit, and one a solid of the palm.
pub const MOST_CONTACTS: usize = 15 + PALM_SOLIDS;

/// A soft-finger contact: it pushes, rubs along the surface and resists twist about the normal.
///
/// With normal force N, tangential force T and torsion M, it holds as long as (T / μN)² + (M / ρN)² ≤ 1: the
/// elliptical limit surface of Howe and Cutkosky (1996), which lies inside Coulomb's cone of half-angle tan⁻¹ μ and
/// inside the limit of pure torsion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftContact {
    /// On the surface, in the object's frame.
    pub position: Vec3,
    /// Outward unit normal of the object.
    pub normal: Vec3,
    /// The digit that touches; `None` is the palm.
    pub digit: Option<Digit>,
    /// μ: coefficient of static friction, more than 0.
    pub friction: f32,
    /// ρ in metres, not negative: the most torsion about the normal per newton of normal force. 0 is a point contact.
    pub torsion_radius: f32,
}

/// What the contacts have to hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// In kilograms, more than 0.
    pub mass: f32,
    /// In metres, in the object's frame.
    pub centre_of_mass: Vec3,
    /// Unit vector against gravity, in the object's frame.
    pub up: Vec3,
    /// In metres, more than 0: torques are divided by it. The lever that matters for the object, such as half the
    /// diagonal of its oriented box. A larger one makes twist count less beside force.
    pub characteristic_length: f32,
}

/// Forces that balance gravity, one entry a contact.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Balance {
    /// What the hand applies to the object, in newtons, in the object's frame.
    pub forces: Vec<Vec3>,
    /// Torsion in newton metres about the inward normal.
    pub torsions: Vec<f32>,
    /// Length of the wrench that is left unbalanced (torque over characteristic length), as a share of the weight.
    pub residual: f32,
    /// Within which limits of friction the forces were sought.
    pub friction_use: FrictionUse,
}

/// How much of friction and torsion forces may use. [`balance`] tries them in this order until the digits press firmly:
/// more of them would find safer forces, and take longer where the first do not do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum FrictionUse {
    /// Less than half, so that twice the load is held, too.
    #[default]
    Sparing,
    /// Most of it.
    Moderate,
    /// All of it.
    Full,
}

impl FrictionUse {
    /// All, the safest first.
    pub const ALL: [Self; 3] = [Self::Sparing, Self::Moderate, Self::Full];
}

/// What [`balance`] and [`epsilon`] keep from one call to the next, so that they need not allocate.
#[derive(Clone, Debug, Default)]
pub struct Buffers {
    cones: Vec<contact_model::ContactCone>,
    solvers: balance::Solvers,
    polytope: polytope::Polytope,
}
