//! Step 5, Immobility Validation: Algorithm 9 (`ISIMMOBILIZINGGRASP`), for strategy F Algorithm 14.
//!
//! Valid as printed: the friction cone has the half-angle cos⁻¹ μ, and the angle of Eq. 4.5 is taken between vectors of
//! six numbers, newtons beside newton metres, so that torque hardly counts.

use std::f32::consts::PI;

use glam::Vec3;

use super::{
    force_distribution::{ForceDistribution, contact_counts},
    wrenches::{Wrench, four_unit_wrenches, printed_cone_cos},
};
use crate::{base::random::AttemptStream, model::grasp::Contact};

/// α of Eq. 4.5: the summed contact wrench must oppose gravity with less than this angle (4.5). A larger one accepts
/// grasps that hold the object less well.
pub const ACCEPTED_WRENCH_ANGLE_DEGREES: f32 = 5.0;

/// How many force distributions are tried (Algorithms 9 and 14).
pub const DISTRIBUTION_TRIES: usize = 100;

/// Distributions between two looks at the stop signal. One takes a few dozen nanoseconds a contact.
const TRIES_PER_LOOK: usize = 25;

/// What Immobility Validation asks of the object.
#[derive(Clone, Copy, Debug)]
pub struct Load {
    /// The wrench of gravity on the object.
    pub gravity: Wrench,
    /// In metres, in the object's frame.
    pub centre_of_mass: Vec3,
    /// Coefficient of static friction.
    pub friction: f32,
}

/// Which distribution is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DistributionChoice {
    /// The one that opposes gravity best (Algorithm 9).
    Best,
    /// The first that suffices (Algorithm 14).
    FirstSufficient,
}

/// Buffers that are kept from one attempt to the next, and the distribution that was taken.
#[derive(Clone, Debug, Default)]
pub struct ImmobilityBuffers {
    unit_wrenches: Vec<[Wrench; 4]>,
    sampled: ForceDistribution,
    taken: ForceDistribution,
}

/// How Immobility Validation ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Immobility {
    /// A distribution opposes gravity with this angle in radians.
    Immobilizing(f32),
    /// None does; the best has this angle in radians.
    NotImmobilizing(f32),
    /// The stop signal came first.
    Interrupted,
}

impl ImmobilityBuffers {
    /// `ISIMMOBILIZINGGRASP`. The distribution that was taken is kept for [`Self::forces`] and
    /// [`Self::digit_totals`].
    pub fn validate(
        &mut self,
        contacts: &[Contact],
        load: &Load,
        choice: DistributionChoice,
        stream: &mut AttemptStream,
        interrupted: &impl Fn() -> bool,
    ) -> Immobility {
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
            if index % TRIES_PER_LOOK == 0 && interrupted() {
                return Immobility::Interrupted;
            }
            self.sampled.sample(contacts, counts, stream);
            let cos = self.sampled.summed_wrench(&self.unit_wrenches).cos_angle(needed);
            if cos > best_cos {
                best_cos = cos;
                std::mem::swap(&mut self.sampled, &mut self.taken);
                if choice == DistributionChoice::FirstSufficient && cos > accepted_cos {
                    break;
                }
            }
        }
        self.scale_to_gravity(needed);
        // The arc cosine is not exact for small angles, but it falls strictly with the cosine that decides.
        let angle = best_cos.clamp(-1.0, 1.0).acos().clamp(0.0, PI);
        if best_cos > accepted_cos {
            Immobility::Immobilizing(angle)
        } else {
            Immobility::NotImmobilizing(angle)
        }
    }

    /// `ScaleToGravitySize`: the summed wrench of the taken distribution becomes as large as that of gravity.
    fn scale_to_gravity(&mut self, needed: Wrench) {
        let summed = self.taken.summed_wrench(&self.unit_wrenches).magnitude();
        if summed > 0.0 {
            let factor = needed.magnitude() / summed;
            for magnitude in self.taken.magnitudes.iter_mut().flatten() {
                *magnitude *= factor;
            }
        }
    }

    /// The force that the taken distribution applies at each contact, in newtons.
    pub fn forces(&self) -> Vec<Vec3> {
        self.taken
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

    /// The force magnitudes of each digit in the taken distribution, thumb first, in newtons: summed over its contacts
    /// and their four wrenches.
    pub fn digit_totals(&self, contacts: &[Contact]) -> [f32; 5] {
        self.taken.digit_totals(contacts)
    }
}
