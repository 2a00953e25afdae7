//! Wrenches (thesis 2.6) and the four of a contact: Algorithm 8 (`FOURUNITWRENCHESFROMCONTACT`).

use std::ops::{Add, AddAssign, Mul};

use glam::Vec3;

use crate::model::{forces::GRAVITY, grasp::Contact};

/// γ of Algorithm 8 in metres: how far the friction cone's tip is moved back along the normal. The thesis says "a
/// small value". A larger one widens the contact area that the four forces stand for and moves their common point off
/// the surface.
pub const CONE_OFFSET: f32 = 0.003;

/// A force and its torque about the centre of mass: W = (F, p × F).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// In newtons.
    pub force: Vec3,
    /// In newton metres.
    pub torque: Vec3,
}

impl Wrench {
    /// The wrench of a force that acts at `anchor`, measured from the centre of mass in metres.
    pub fn of_force(force: Vec3, anchor: Vec3) -> Self {
        Self {
            force,
            torque: anchor.cross(force),
        }
    }

    /// The wrench of gravity on a mass in kilograms. It acts at the centre of mass, so that it has no torque.
    pub fn of_gravity(mass: f32, up: Vec3) -> Self {
        Self {
            force: up * (-GRAVITY * mass),
            torque: Vec3::ZERO,
        }
    }

    /// Product of the two as vectors of six numbers: newtons and newton metres side by side, as Eq. 4.5 has it.
    pub fn dot(self, other: Self) -> f32 {
        self.force.dot(other.force) + self.torque.dot(other.torque)
    }

    /// Length as a vector of six numbers.
    pub fn magnitude(self) -> f32 {
        self.dot(self).sqrt()
    }

    /// Cosine of the angle to another wrench; -1, the worst, if one of them vanishes.
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

/// Cosine of the friction cone's half-angle as printed: the half-angle is cos⁻¹ μ (2.6, 4.5), 70° for μ = 0.34, where
/// physics has tan⁻¹ μ. From μ = 1 on the printed cone has closed to its axis.
pub fn printed_cone_cos(friction: f32) -> f32 {
    friction.clamp(0.0, 1.0)
}

/// `FOURUNITWRENCHESFROMCONTACT`: unit forces along four lines on the boundary of the friction cone, with their torques
/// about the centre of mass.
///
/// The hand pushes, so the cone opens into the object; its tip is γ outside the surface, and each force acts where its
/// line, of length γ from the tip, ends. `cone_cos` is the cosine of the cone's half-angle.
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
