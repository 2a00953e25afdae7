//! Step 5, Immobility Validation: Algorithm 9 (`ISIMMOBILIZINGGRASP`); for strategy F, Algorithm 14.
//!
//! Follows the thesis as printed: the friction cone has the half-angle cos⁻¹ μ, and the angle of Eq. 4.5 is between
//! six-vectors that mix newtons and newton metres, so torque hardly counts.

use std::f32::consts::PI;

use glam::Vec3;

use super::{
    force_distribution::{ForceDistribution, contact_counts},
    wrenches::{Wrench, four_unit_wrenches, printed_cone_cos},
};
use crate::{
    base::{
        random::AttemptStream,
        stop::{Stop, Stopped},
    },
    model::grasp::Contact,
};

/// α of Eq. 4.5 in degrees (4.5): largest angle between the summed contact wrench and the one that cancels gravity. A
/// larger one accepts grasps that hold the object less well.
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

/// Which force distribution is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DistributionChoice {
    /// The one that opposes gravity best (Algorithm 9).
    Best,
    /// The first that is good enough (Algorithm 14).
    FirstSufficient,
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
    /// `ISIMMOBILIZINGGRASP`. Keeps the chosen distribution for [`Self::forces`] and [`Self::digit_totals`].
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn validate(
        &mut self,
        contacts: &[Contact],
        load: &Load,
        choice: DistributionChoice,
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
                if choice == DistributionChoice::FirstSufficient && cos > accepted_cos {
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
