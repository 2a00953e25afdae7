//! Hooks: a load that hangs in bent fingers, held by its weight.
//!
//! A hook resists no push from below, so closure says nothing about it. Instead, the load must hang, the fingers must
//! enclose its handle, and the contacts must carry the weight.
//!
//! **The load hangs.** It swings like a pendulum about the held part until its centre of mass is below. The
//! forces that carry it are those of the load at rest, with the hand as it is ([`Hang::load_at_rest`]). A load that
//! would have to swing far does not count as hanging.
//!
//! **The fingers enclose it.** For a load in a finger, a push to the side by a share s of the weight tilts gravity by
//! tan⁻¹ s. The load stays while the way out leads uphill on either side. From where it rests, the finger extends a distance
//! r to the side and a height h up to its knuckle, or to its tip; the way out is h − s r high along the tilted
//! vertical, times cos(tan⁻¹ s). Friction only helps.

use glam::{Mat3, Vec3};

use super::{closing::ClosedDigit, immobility::Load, solids::TaperedCapsule};
use crate::model::{
    grasp::Contact,
    hand::{Digit, HandPart, Phalanx},
};

/// Push to the side that a hanging load must bear, as a share of the weight: a load that is carried at a walk swings as
/// much. A larger share requires fingers that are bent further.
pub const SIDEWAYS_SHARE: f32 = 0.2;

/// Smallest height of the way out of a finger under [`SIDEWAYS_SHARE`], in metres: flesh yields by less. A larger one
/// requires more of the fingertip on the far side.
pub const MIN_LIP: f32 = 0.005;

/// Largest angle by which a hanging load swings until it is at rest, in radians. A larger one accepts loads that are held
/// out lying on their side.
pub const MAX_SWING: f32 = 0.55;

/// Smallest depth of the centre of mass below the pivot, in metres. With less, a load turns over at a touch.
const MIN_DEPTH: f32 = 0.02;

/// Fewest fingers that hold: a load turns about a single one.
const MIN_FINGERS: usize = 2;

/// Cosine of the largest angle from the vertical at which a finger's push counts as from below.
const FROM_BELOW_COS: f32 = 0.6;

/// Weight of the middle of the contacts against their lines of action in finding the pivot.
const TOWARD_MIDDLE: f32 = 0.002;

/// How a load hangs in bent fingers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hang {
    /// The pivot of the load's swing, in metres, in the object's frame: the middle of a round bar.
    pub pivot: Vec3,
    /// Height of the way out of the finger that is the easiest to leave, in metres; at least [`MIN_LIP`].
    pub lip: f32,
}

impl Hang {
    /// How a load with this centre of mass hangs in closed digits with these contacts; `None` if it does not. `up` is the
    /// unit vector against gravity. Everything is in the object's frame, in metres.
    pub fn of(
        contacts: &[Contact],
        digits: &[ClosedDigit; 5],
        centre_of_mass: Vec3,
        up: Vec3,
    ) -> Option<Self> {
        let fingers = &Digit::ALL[1..];
        let lips = fingers
            .iter()
            .filter_map(|&finger| lip(finger, contacts, &digits[finger.index()].links, up))
            .filter(|&lip| lip >= MIN_LIP);
        let (count, lip) = lips.fold((0, f32::INFINITY), |(count, least), lip| {
            (count + 1, least.min(lip))
        });
        let pivot = pivot(contacts);
        let lever = pivot - centre_of_mass;
        let hangs = lever.dot(up) >= MIN_DEPTH && lever.angle_between(up) <= MAX_SWING;
        (hangs && count >= MIN_FINGERS).then_some(Self { pivot, lip })
    }

    /// The load once it has swung until its centre of mass is below the pivot.
    #[must_use]
    pub fn load_at_rest(&self, load: Load) -> Load {
        Load {
            centre_of_mass: self.pivot - load.up * self.pivot.distance(load.centre_of_mass),
            ..load
        }
    }

    /// The height of the way out as a multiple of the required one.
    pub(crate) fn relative_lip(&self) -> f32 {
        self.lip / MIN_LIP
    }
}

/// Height of a finger's lower way out, in metres, under [`SIDEWAYS_SHARE`]; `None` if it does not push from below.
fn lip(finger: Digit, contacts: &[Contact], links: &[TaperedCapsule; 3], up: Vec3) -> Option<f32> {
    let lifting = Phalanx::ALL.into_iter().filter_map(|phalanx| {
        let part = HandPart::Phalanx(finger, phalanx);
        let contact = contacts.iter().find(|contact| contact.part == part)?;
        let lift = -contact.normal.dot(up);
        (lift >= FROM_BELOW_COS).then_some((phalanx.index(), contact.position, lift))
    });
    let (link, rest, _) = lifting.max_by(|a, b| a.2.total_cmp(&b.2))?;
    let way_out = |centre: Vec3, radius: f32| {
        let offset = centre - rest;
        let rise = offset.dot(up);
        let run = (offset - up * rise).length();
        (rise + radius - SIDEWAYS_SHARE * run) / SIDEWAYS_SHARE.hypot(1.0)
    };
    let to_knuckle = links[..=link]
        .iter()
        .map(|link| way_out(link.start, link.start_radius));
    let to_tip = links[link..]
        .iter()
        .map(|link| way_out(link.end, link.end_radius));
    let highest_to_knuckle = to_knuckle.fold(f32::NEG_INFINITY, f32::max);
    Some(to_tip.fold(f32::NEG_INFINITY, f32::max).min(highest_to_knuckle))
}

/// The point nearest to the lines along which the contacts push, in the least-squares sense: the middle of a round bar.
fn pivot(contacts: &[Contact]) -> Vec3 {
    let count = contacts.len().max(1) as f32;
    let middle = contacts.iter().map(|contact| contact.position).sum::<Vec3>() / count;
    // Minimises Σ |(1 − n nᵀ)(x − p)|² + w |x − middle|².
    let weight = TOWARD_MIDDLE * count;
    let mut normal_matrix = Mat3::from_diagonal(Vec3::splat(weight));
    let mut right_side = Vec3::ZERO;
    for contact in contacts {
        let n = contact.normal;
        let across = Mat3::IDENTITY - Mat3::from_cols(n * n.x, n * n.y, n * n.z);
        normal_matrix += across;
        right_side += across * (contact.position - middle);
    }
    middle + normal_matrix.inverse() * right_side
}
