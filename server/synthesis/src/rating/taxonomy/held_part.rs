//! The part of the object between the digits, measured in the hand's lengths and axes.

use glam::Vec3;

use crate::{
    geometry::{
        local_shape::{Curvature, LocalShape, Symmetric},
        surface_samples::SurfaceSample,
    },
    model::{
        grasp::Contact,
        hand::{HandPose, rig::Rig},
    },
};

/// Radius of the part as a multiple of the root mean square distance of the contacts from its centre. A larger one includes
/// the ends of a can that is held by its side.
const RADIUS_PER_SPAN: f32 = 1.2;

/// Range of that radius, in hand lengths: 3 to 7 cm on an adult's hand. Less would not tell a rod from a plate; more is out
/// of the hand's reach.
const RADIUS_RANGE: [f32; 2] = [0.15, 0.35];

/// Diameter of a rod over [`HeldPart::thickness`]: √2 for a round one, 1.34 for a square one.
const DIAMETER_PER_THICKNESS: f32 = 1.38;

/// [`HeldPart::thin`] over which a section becomes as thick as wide. An oval handle is a bar.
pub(super) const EVEN_SECTION: [f32; 2] = [0.78, 0.86];

/// The shape of the held part. By default, nothing is held.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HeldPart {
    /// Its smallest extent over its middle one, 0 to 1: of their standard deviations on the surface.
    pub(super) thin: f32,
    /// Its smallest extent over its largest one, 0 to 1, measured alike.
    pub(super) compact: f32,
    /// Its smallest extent, in hand lengths: the thickness of a sheet.
    pub(super) thickness: f32,
    /// How well a sphere fits: [`crate::geometry::local_shape::Part::sphericity`].
    pub(super) sphericity: f32,
    /// How alike it is on all sides around the palm's normal, 0 to 1: 1 for a disk or jar that the palm faces, near 0 for a
    /// can that lies across the hand and for what is long.
    pub(super) all_around: f32,
    /// How it curves under the contacts; flat if `thin` is below [`EVEN_SECTION`], where nobody asks.
    pub(super) curvature: Curvature,
}

impl HeldPart {
    /// Measures the surface around the middle of the contacts. Contacts, pose and shape are in the same frame, in metres.
    pub(super) fn of(rig: &Rig, pose: &HandPose, contacts: &[Contact], shape: &LocalShape) -> Self {
        let Some(centre) = middle(contacts) else {
            return Self::default();
        };
        let squared = contacts
            .iter()
            .map(|contact| contact.position.distance_squared(centre));
        let span = (squared.sum::<f32>() / contacts.len() as f32).sqrt();
        let [least, most] = RADIUS_RANGE.map(|lengths| lengths * rig.reach);
        let radius = (RADIUS_PER_SPAN * span).clamp(least, most);
        let Some(part) = shape.around(centre, radius) else {
            return Self::default();
        };
        let [largest, middle, smallest] = part.spreads.map(|spread| spread.max(f32::MIN_POSITIVE));
        let thin = smallest / middle;
        // Only what is as thick as wide can be a ball, so most parts need no closer look.
        let curvature = if thin > EVEN_SECTION[0] {
            let touched = contacts.iter().map(|contact| SurfaceSample {
                position: contact.position,
                normal: contact.normal,
            });
            shape.under(centre, radius, touched)
        } else {
            Curvature::default()
        };
        let wrist = pose.frame_from_wrist;
        let [x, y] = [Vec3::X, Vec3::Y].map(|axis| wrist.transform_vector(axis));
        Self {
            thin,
            compact: smallest / largest,
            thickness: 2.0 * smallest / rig.reach.max(f32::MIN_POSITIVE),
            curvature,
            sphericity: part.sphericity,
            all_around: evenness(&part.facing, x, y) * evenness(&part.spread, x, y),
        }
    }
}

impl HeldPart {
    /// Its diameter, in hand lengths, if it is as thick as wide: exact within 3 % for round and square rods.
    pub(super) fn diameter(&self) -> f32 {
        DIAMETER_PER_THICKNESS * self.thickness
    }
}

/// The point halfway between what the fingers touch and what thumb and palm do; `None` without a contact.
fn middle(contacts: &[Contact]) -> Option<Vec3> {
    let mean = |of_fingers: bool| {
        let (mut sum, mut count) = (Vec3::ZERO, 0.0);
        for contact in contacts {
            if (contact.part.is_thumb() == Some(false)) == of_fingers {
                sum += contact.position;
                count += 1.0;
            }
        }
        (count > 0.0).then(|| sum / count)
    };
    match (mean(true), mean(false)) {
        (Some(fingers), Some(others)) => Some(fingers.midpoint(others)),
        (one, other) => one.or(other),
    }
}

/// How alike second moments are in all directions of a plane, 0 to 1: the smallest over the largest.
fn evenness(moments: &Symmetric, x: Vec3, y: Vec3) -> f32 {
    let (xx, yy, xy) = (
        moments.between(x, x),
        moments.between(y, y),
        moments.between(x, y),
    );
    let mean = 0.5 * (xx + yy);
    let apart = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
    ((mean - apart) / (mean + apart).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0)
}
