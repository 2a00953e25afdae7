//! Step 5, Immobility Validation: Algorithm 9 (`ISIMMOBILIZINGGRASP`); for strategy F, Algorithm 14; with wrenches (Algorithm 8,
//! `FOURUNITWRENCHESFROMCONTACT`) and force distributions (Algorithm 10, `FORCEDISTRIBUTIONSOVERCONTACTS`).
//!
//! Follows the thesis as printed: the friction cone has the half-angle cos⁻¹ μ, and the angle of Eq. 4.5 is between
//! six-vectors that mix newtons and newton metres, so torque hardly counts.

use std::{f32::consts::PI, ops::Mul};

use glam::Vec3;

use crate::{
    base::{
        random::AttemptStream,
        stop::{Stop, Stopped},
    },
    model::{
        grasp::{COMFORTABLE_SHARES, Contact, GRAVITY},
        hand::Digit,
    },
};

/// α of Eq. 4.5 in degrees (4.5): largest angle between the summed contact wrench and the wrench that cancels gravity.
pub const ACCEPTED_WRENCH_ANGLE_DEGREES: f32 = 5.0;

/// Number of force distributions tried (Algorithms 9 and 14).
pub const DISTRIBUTION_TRIES: usize = 100;

/// Distributions tried between two checks of the stop signal; each takes a few dozen nanoseconds per contact.
const TRIES_PER_STOP_CHECK: usize = 25;

/// The properties of the object that Immobility Validation uses.
#[derive(Clone, Copy, Debug)]
pub struct Load {
    /// Wrench of gravity about the centre of mass.
    pub gravity: Wrench,
    /// Centre of mass in the object's frame, in metres.
    pub centre_of_mass: Vec3,
    /// Coefficient of static friction.
    pub friction: f32,
}

/// Buffers reused across attempts, and the chosen distribution.
#[derive(Clone, Debug, Default)]
pub struct ImmobilityBuffers {
    unit_wrenches: Vec<[Wrench; 4]>,
    sampled: ForceDistribution,
    chosen: ForceDistribution,
}

/// Outcome of Immobility Validation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Immobility {
    /// A distribution holds the object; its angle of Eq. 4.5 in radians.
    Immobilizing(f32),
    /// No distribution does; the smallest angle in radians.
    NotImmobilizing(f32),
}

impl ImmobilityBuffers {
    /// `ISIMMOBILIZINGGRASP`: chooses the distribution that opposes gravity best (Algorithm 9) or, with `takes_first`, the first
    /// that is good enough (Algorithm 14). Keeps the chosen distribution for [`Self::forces`] and [`Self::digit_totals`].
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn validate(
        &mut self,
        contacts: &[Contact],
        load: &Load,
        takes_first: bool,
        stream: &mut AttemptStream,
        stop: Stop<'_>,
    ) -> Result<Immobility, Stopped> {
        let cone_cos = printed_cone_cos(load.friction);
        self.unit_wrenches.clear();
        self.unit_wrenches.extend(
            contacts
                .iter()
                .map(|contact| four_unit_wrenches(contact, load.centre_of_mass, cone_cos)),
        );
        let counts = contact_counts(contacts);
        let needed = load.gravity * -1.0;
        let accepted_cos = ACCEPTED_WRENCH_ANGLE_DEGREES.to_radians().cos();
        let mut best_cos = f32::NEG_INFINITY;
        for index in 0..DISTRIBUTION_TRIES {
            stop.check_every(TRIES_PER_STOP_CHECK, index)?;
            self.sampled.sample(contacts, counts, stream);
            let cos = self.sampled.summed_wrench(&self.unit_wrenches).cos_angle(needed);
            if cos > best_cos {
                best_cos = cos;
                std::mem::swap(&mut self.sampled, &mut self.chosen);
                if takes_first && cos > accepted_cos {
                    break;
                }
            }
        }
        self.scale_to_gravity(needed);
        // acos is inexact for small angles; the decision below uses the cosine.
        let angle = best_cos.clamp(-1.0, 1.0).acos().clamp(0.0, PI);
        Ok(if best_cos > accepted_cos {
            Immobility::Immobilizing(angle)
        } else {
            Immobility::NotImmobilizing(angle)
        })
    }

    /// `ScaleToGravitySize`: scales the chosen distribution until its summed wrench has the magnitude of gravity's.
    fn scale_to_gravity(&mut self, needed: Wrench) {
        let summed = self.chosen.summed_wrench(&self.unit_wrenches).magnitude();
        if summed > 0.0 {
            let factor = needed.magnitude() / summed;
            for magnitude in self.chosen.magnitudes.iter_mut().flatten() {
                *magnitude *= factor;
            }
        }
    }

    /// Force of the chosen distribution at each contact, in newtons.
    pub fn forces(&self) -> Vec<Vec3> {
        self.chosen
            .magnitudes
            .iter()
            .zip(&self.unit_wrenches)
            .map(|(magnitudes, wrenches)| {
                magnitudes
                    .iter()
                    .zip(wrenches)
                    .map(|(&magnitude, wrench)| wrench.force * magnitude)
                    .sum()
            })
            .collect()
    }

    /// Total force magnitude of each digit in the chosen distribution, thumb first, in newtons: the sum over its contacts
    /// and their four unit wrenches.
    pub fn digit_totals(&self, contacts: &[Contact]) -> [f32; 5] {
        self.chosen.digit_totals(contacts)
    }
}

/// Range of the uniform factor on each share (Algorithm 10 says only "random noise").
const SHARE_NOISE: [f32; 2] = [0.5, 1.5];

/// Force magnitudes for the four unit wrenches of each contact.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForceDistribution {
    /// λ: for each contact, a non-negative factor per unit wrench.
    pub magnitudes: Vec<[f32; 4]>,
}

impl ForceDistribution {
    /// `FORCEDISTRIBUTIONSOVERCONTACTS`, into this buffer: the comfortable shares with noise, split evenly among a digit's
    /// contacts and at random among a contact's four wrenches.
    pub fn sample(&mut self, contacts: &[Contact], contact_counts: [u32; 5], stream: &mut AttemptStream) {
        let noisy = COMFORTABLE_SHARES.map(|share| share * stream.between(SHARE_NOISE[0], SHARE_NOISE[1]));
        self.magnitudes.clear();
        self.magnitudes.extend(contacts.iter().map(|contact| {
            let size = contact.part.digit().map_or(0.0, |digit| {
                noisy[digit.index()] / contact_counts[digit.index()] as f32
            });
            stream.four_shares().map(|share| size * share)
        }));
    }

    /// Sum of the contact wrenches.
    pub fn summed_wrench(&self, unit_wrenches: &[[Wrench; 4]]) -> Wrench {
        let mut sum = Wrench::default();
        for (magnitudes, wrenches) in self.magnitudes.iter().zip(unit_wrenches) {
            for (&magnitude, wrench) in magnitudes.iter().zip(wrenches) {
                sum.force += wrench.force * magnitude;
                sum.torque += wrench.torque * magnitude;
            }
        }
        sum
    }

    /// Total force magnitude of each digit, thumb first.
    pub fn digit_totals(&self, contacts: &[Contact]) -> [f32; 5] {
        let mut totals = [0.0; 5];
        for (contact, magnitudes) in contacts.iter().zip(&self.magnitudes) {
            if let Some(digit) = contact.part.digit() {
                totals[digit.index()] += magnitudes.iter().sum::<f32>();
            }
        }
        totals
    }
}

/// Number of contacts of each digit, thumb first.
pub fn contact_counts(contacts: &[Contact]) -> [u32; 5] {
    Digit::ALL.map(|digit| {
        let of_digit = contacts
            .iter()
            .filter(|contact| contact.part.digit() == Some(digit));
        of_digit.count() as u32
    })
}

/// γ of Algorithm 8 in metres ("a small value"): offset of the friction cone's apex from the surface along the normal.
const CONE_OFFSET: f32 = 0.003;

/// A force and its torque about the centre of mass: W = (F, p × F).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force in newtons.
    pub force: Vec3,
    /// Torque in newton metres.
    pub torque: Vec3,
}

impl Wrench {
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
        let force = inward * cone_cos + across * cone_sin;
        let anchor = cone_origin + force * CONE_OFFSET;
        Wrench {
            force,
            torque: anchor.cross(force),
        }
    })
}
