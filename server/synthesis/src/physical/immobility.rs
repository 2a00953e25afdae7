//! Immobility: contact forces that hold the object, and closure.
//!
//! A wrench is six dimensionless numbers: force, and torque about the middle of the contacts divided by half their span, so that
//! units do not weight one against the other (the thesis mixes newtons and newton metres, Eq. 4.5). Contacts are soft fingers with
//! exact, curved friction limits. Both solvers query those limits only for the wrench that reaches farthest in a direction; all
//! they build lies inside the true limits, so every answer is conservative.
//!
//! - [`balance()`]: forces that hold the object against gravity, as comfortably as possible (non-negative least squares
//!   after Lawson and Hanson, over cones instead of a matrix);
//! - [`epsilon`]: the largest disturbance that the contacts resist in every direction (Ferrari and Canny), by an
//!   expanding polytope in six dimensions.

mod balance;
mod closure;
mod least_squares;

use glam::{DVec3, Vec3};

pub(crate) use self::balance::{firm_force, nearest_balance};
pub use self::{
    balance::{BALANCE_TOLERANCE, MAX_CONTACT_FORCE, balance, balance_with},
    closure::{EPSILON_TOLERANCE, epsilon, epsilon_upper_bound},
};

use super::solids::PALM_SOLIDS;
use crate::model::hand::Digit;

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

/// Reference point and unit of torques.
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
    /// Reference point and unit of torques.
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

/// How much of friction and torsion the forces may use. [`balance()`] tries these in order until the digits press firmly.
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
    cones: Vec<ContactCone>,
    solvers: balance::Solvers,
    polytope: closure::Polytope,
}

/// A force, and its torque about the centre of the torque scale over its length.
pub(super) type ScaledWrench = [f64; 6];

/// Dot product of two slices of equal length.
#[inline]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four independent sums: a single one would wait for each addition before starting the next.
    let (a_fours, a_rest) = a.as_chunks::<4>();
    let (b_fours, b_rest) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    // Indexed, because zipped iterators are not inlined at the call sites.
    for four in 0..a_fours.len() {
        for k in 0..4 {
            sums[k] += a_fours[four][k] * b_fours[four][k];
        }
    }
    let mut rest = -0.0;
    for k in 0..a_rest.len() {
        rest += a_rest[k] * b_rest[k];
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// Bisection steps in [`ContactCone::best_push_at_price`], down to a ten-millionth of the friction.
const HALVINGS: usize = 24;

/// A contact's friction limits, prepared for queries. Everything is per newton of normal force.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactCone {
    inward: DVec3,
    /// From the centre of the torque scale to the contact, over its length.
    arm: DVec3,
    /// μ².
    friction_squared: f64,
    /// σ²: square of the torsion radius over the length of the torque scale.
    torsion_squared: f64,
}

/// Force and torsion of a contact at a normal force of one newton.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UnitPush {
    pub(super) force: DVec3,
    /// About the inward normal, over the length of the torque scale.
    pub(super) torsion: f64,
}

/// A direction resolved at a contact, in the notation of [`ContactCone::farthest_push`].
struct ContactDirection {
    /// a·n.
    normal: f64,
    /// aₜ.
    across: DVec3,
    /// b.
    about_normal: f64,
    /// q.
    gain: f64,
}

impl ContactCone {
    fn new(contact: &SoftContact, load: &Load) -> Self {
        let TorqueScale { centre, length } = load.torque_scale;
        let length = f64::from(length);
        Self {
            inward: -contact.normal.as_dvec3().normalize_or_zero(),
            arm: (contact.position.as_dvec3() - centre.as_dvec3()) / length,
            friction_squared: f64::from(contact.friction).powi(2),
            torsion_squared: (f64::from(contact.torsion_radius) / length).powi(2),
        }
    }

    /// The reach of [`ContactCone::farthest_push`] without the push, in half the time.
    pub(super) fn reach(&self, direction: &ScaledWrench, share: f64) -> f64 {
        let ContactDirection { normal, gain, .. } = self.resolve(direction);
        normal + share * gain
    }

    /// The push whose wrench reaches farthest along `direction`, and its reach, when `share` of friction and torsion
    /// may be used.
    ///
    /// A push has force n + t and torsion s with |t|²/μ² + s²/σ² ≤ 1. Its wrench times the direction (u, v) is
    /// (n + t)·a + s b with a = u + v × arm and b = v·n. Over the ellipsoid, that is largest at t = μ² aₜ / q and
    /// s = σ² b / q with q² = μ² |aₜ|² + σ² b², where it is a·n + q. A share scales t, s and q.
    pub(super) fn farthest_push(&self, direction: &ScaledWrench, share: f64) -> (f64, UnitPush) {
        let ContactDirection {
            normal,
            across,
            about_normal,
            gain,
        } = self.resolve(direction);
        let push = if gain > 0.0 {
            UnitPush {
                force: self.inward + across * (share * self.friction_squared / gain),
                torsion: share * self.torsion_squared * about_normal / gain,
            }
        } else {
            self.normal_push()
        };
        (normal + share * gain, push)
    }

    /// The push that maximises its reach along `direction` minus `price` per newton of its force, and that maximum,
    /// when `share` of friction and torsion may be used. `price` must not be negative.
    ///
    /// In the notation of [`ContactCone::farthest_push`], with r = |aₜ|: torsion is free, so all of it that friction
    /// leaves is used, and t = μ u along aₜ, s = σ √(1 − u²). The gain r μ u + |b| σ √(1 − u²) − price √(1 + μ² u²)
    /// is concave in u, so its slope changes sign once between 0 and 1.
    pub(super) fn best_push_at_price(
        &self,
        direction: &ScaledWrench,
        share: f64,
        price: f64,
    ) -> (f64, UnitPush) {
        if price <= 0.0 {
            return self.farthest_push(direction, share);
        }
        let ContactDirection {
            normal,
            across,
            about_normal,
            ..
        } = self.resolve(direction);
        let rub = across.length();
        let max_tangential = share * self.friction_squared.sqrt();
        let max_torsion = share * self.torsion_squared.sqrt();
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let used = 0.5 * (low + high);
            let tangential = max_tangential * used;
            let gained = max_tangential * (rub - price * tangential / (1.0 + tangential * tangential).sqrt());
            // The slope times √(1 − u²), which stays finite where all of the friction is used.
            if gained * (1.0 - used * used).sqrt() > about_normal.abs() * max_torsion * used {
                low = used;
            } else {
                high = used;
            }
        }
        let tangential = max_tangential * high;
        // No torsion where it gains nothing.
        let torsion = if about_normal == 0.0 {
            0.0
        } else {
            max_torsion * (1.0 - high * high).sqrt() * about_normal.signum()
        };
        let push = UnitPush {
            force: self.inward + across.normalize_or_zero() * tangential,
            torsion,
        };
        let reach = normal + rub * tangential + about_normal * torsion;
        (reach - price * push.force.length(), push)
    }

    #[inline]
    fn resolve(&self, direction: &ScaledWrench) -> ContactDirection {
        let [ux, uy, uz, vx, vy, vz] = *direction;
        let twist = DVec3::new(vx, vy, vz);
        let along = DVec3::new(ux, uy, uz) + twist.cross(self.arm);
        let normal = along.dot(self.inward);
        let across = along - self.inward * normal;
        let about_normal = twist.dot(self.inward);
        let gain = (self.friction_squared * across.length_squared()
            + self.torsion_squared * about_normal * about_normal)
            .sqrt();
        ContactDirection {
            normal,
            across,
            about_normal,
            gain,
        }
    }

    /// The wrench of a push, or of a sum of pushes.
    pub(super) fn wrench(&self, push: &UnitPush) -> ScaledWrench {
        let torque = self.arm.cross(push.force) + self.inward * push.torsion;
        let force = push.force;
        [force.x, force.y, force.z, torque.x, torque.y, torque.z]
    }

    /// The push along the normal alone.
    pub(super) fn normal_push(&self) -> UnitPush {
        UnitPush {
            force: self.inward,
            torsion: 0.0,
        }
    }
}

/// The contacts' friction limits in a buffer.
fn prepared_cones<'a>(
    contacts: &[SoftContact],
    load: &Load,
    cones: &'a mut Vec<ContactCone>,
) -> &'a [ContactCone] {
    cones.clear();
    cones.extend(contacts.iter().map(|contact| ContactCone::new(contact, load)));
    cones
}

/// The support function of the hull of unit wrenches: the wrench, over all contacts with one newton of normal force
/// each, that reaches farthest along `direction`, and its reach.
pub(super) fn farthest_wrench(cones: &[ContactCone], direction: &ScaledWrench) -> (f64, ScaledWrench) {
    let mut best = (f64::NEG_INFINITY, [0.0; 6]);
    let mut chosen = None;
    for cone in cones {
        let reach = cone.reach(direction, 1.0);
        if reach > best.0 {
            best.0 = reach;
            chosen = Some(cone);
        }
    }
    if let Some(cone) = chosen {
        best.1 = cone.wrench(&cone.farthest_push(direction, 1.0).1);
    }
    best
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, TAU};

    use glam::Vec3;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use crate::model::hand::Digit;

    /// Steps of each angle in the exhaustive search.
    const STEPS: usize = 160;

    /// The largest gain over a grid of pushes at the friction limits.
    fn largest_gain(cone: &ContactCone, direction: &ScaledWrench, share: f64, price: f64) -> f64 {
        let (side, other) = cone.inward.any_orthonormal_pair();
        let at = |turn: usize, tilt: usize| {
            let (turn, tilt) = (
                TAU * turn as f64 / STEPS as f64,
                FRAC_PI_2 * (tilt as f64 / STEPS as f64 * 2.0 - 1.0),
            );
            let rub = share * cone.friction_squared.sqrt() * tilt.cos();
            let push = UnitPush {
                force: cone.inward + (side * turn.cos() + other * turn.sin()) * rub,
                torsion: share * cone.torsion_squared.sqrt() * tilt.sin(),
            };
            dot(&cone.wrench(&push), direction) - price * push.force.length()
        };
        let pushes = (0..STEPS).flat_map(|turn| (0..=STEPS).map(move |tilt| (turn, tilt)));
        let gains = pushes.map(|(turn, tilt)| at(turn, tilt));
        gains.fold(f64::NEG_INFINITY, f64::max)
    }

    #[test]
    fn best_push_at_price_is_optimal() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(4);
        let load = Load {
            mass: 0.2,
            centre_of_mass: Vec3::ZERO,
            up: Vec3::Y,
            torque_scale: TorqueScale {
                centre: Vec3::ZERO,
                length: 0.05,
            },
        };
        for case in 0..60 {
            let mut vector = || Vec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0)));
            let cone = ContactCone::new(
                &SoftContact {
                    position: vector() * 0.05,
                    normal: vector().normalize_or(Vec3::X),
                    friction: 0.8,
                    torsion_radius: 0.004,
                    digit: Some(Digit::Thumb),
                },
                &load,
            );
            let direction: ScaledWrench = std::array::from_fn(|_| random.random_range(-1.0..1.0));
            let share = [0.45, 1.0][case % 2];
            let price = [0.0, 0.3, 2.0][case % 3];
            let (gain, push) = cone.best_push_at_price(&direction, share, price);
            let own = dot(&cone.wrench(&push), &direction) - price * push.force.length();
            assert!(
                (gain - own).abs() < 1e-12,
                "case {case}: reported gain {gain}, recomputed {own}"
            );
            let rub = (push.force - cone.inward).length_squared() / cone.friction_squared;
            let used = rub + push.torsion.powi(2) / cone.torsion_squared;
            assert!(
                used < share * share + 1e-9,
                "case {case}: uses {used} of the squared friction limit"
            );
            let most = largest_gain(&cone, &direction, share, price);
            assert!(
                gain > most - 1e-12,
                "case {case}: gain {gain}, but {most} is possible"
            );
            assert!(gain < most + 1e-3, "case {case}: gain {gain} exceeds {most}");
            if price == 0.0 {
                let (reach, _) = cone.farthest_push(&direction, share);
                assert!(
                    (gain - reach).abs() < 1e-9,
                    "case {case}: gain {gain} at no price, reach {reach}"
                );
            }
        }
    }
}
