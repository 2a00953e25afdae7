//! Wrenches (thesis 2.6) and the four unit wrenches of a contact: Algorithm 8 (`FOURUNITWRENCHESFROMCONTACT`).

use std::ops::{Add, AddAssign, Mul};

use glam::Vec3;

use crate::model::{forces::GRAVITY, grasp::Contact};

/// γ of Algorithm 8 in metres ("a small value"): offset of the friction cone's apex from the surface along the normal. A
/// larger one widens the contact area that the four forces represent.
pub(crate) const CONE_OFFSET: f32 = 0.003;

/// A force and its torque about the centre of mass: W = (F, p × F).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force in newtons.
    pub force: Vec3,
    /// Torque in newton metres.
    pub torque: Vec3,
}

impl Wrench {
    /// Wrench of a force acting at `anchor`, in metres relative to the centre of mass.
    pub(crate) fn of_force(force: Vec3, anchor: Vec3) -> Self {
        Self {
            force,
            torque: anchor.cross(force),
        }
    }

    /// Wrench of gravity on a mass in kilograms. It acts at the centre of mass and has no torque.
    pub fn of_gravity(mass: f32, up: Vec3) -> Self {
        Self {
            force: up * (-GRAVITY * mass),
            torque: Vec3::ZERO,
        }
    }

    /// Dot product as six-vectors, mixing newtons and newton metres as Eq. 4.5 does.
    pub fn dot(self, other: Self) -> f32 {
        self.force.dot(other.force) + self.torque.dot(other.torque)
    }

    /// Length as a six-vector.
    pub fn magnitude(self) -> f32 {
        self.dot(self).sqrt()
    }

    /// Cosine of the angle to another wrench; -1 (the worst) if either is zero.
    pub fn cos_angle(self, other: Self) -> f32 {
        let product = self.magnitude() * other.magnitude();
        if product > 0.0 {
            self.dot(other) / product
        } else {
            -1.0
        }
    }
}

impl Add for Wrench {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            force: self.force + other.force,
            torque: self.torque + other.torque,
        }
    }
}

impl AddAssign for Wrench {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Mul<f32> for Wrench {
    type Output = Self;

    fn mul(self, factor: f32) -> Self {
        Self {
            force: self.force * factor,
            torque: self.torque * factor,
        }
    }
}

/// Cosine of the friction cone's half-angle as the thesis prints it: cos⁻¹ μ (2.6, 4.5), 70° for μ = 0.34. Physically it
/// is tan⁻¹ μ. For μ ≥ 1 the printed cone degenerates to its axis.
pub fn printed_cone_cos(friction: f32) -> f32 {
    friction.clamp(0.0, 1.0)
}

/// `FOURUNITWRENCHESFROMCONTACT`: unit forces along four edges of the friction cone, with their torques about the centre
/// of mass.
///
/// The hand pushes, so the cone opens into the object. Its apex is γ outside the surface, and each force acts γ from the
/// apex along its edge. `cone_cos` is the cosine of the cone's half-angle.
pub fn four_unit_wrenches(contact: &Contact, centre_of_mass: Vec3, cone_cos: f32) -> [Wrench; 4] {
    let inward = -contact.normal;
    let (right, forward) = inward.any_orthonormal_pair();
    let cone_sin = (1.0 - cone_cos * cone_cos).max(0.0).sqrt();
    let cone_origin = contact.position - centre_of_mass - inward * CONE_OFFSET;
    [right, forward, -right, -forward].map(|across| {
        let direction = inward * cone_cos + across * cone_sin;
        Wrench::of_force(direction, cone_origin + direction * CONE_OFFSET)
    })
}
