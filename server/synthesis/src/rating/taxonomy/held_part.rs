//! The part of the object between the digits, measured in the hand's lengths and axes, and how well it fits the shapes of the
//! taxonomy's pictures.

use glam::Vec3;

use super::features::Features;
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

/// Radius of the part as a multiple of the root mean square distance of the contacts from its centre.
const RADIUS_PER_SPAN: f32 = 1.2;

/// Range of that radius, in hand lengths: 3 to 7 cm on an adult's hand.
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
    /// Fit of a sphere: [`crate::geometry::local_shape::Part::sphericity`].
    pub(super) sphericity: f32,
    /// How alike it is on all sides around the palm's normal, 0 to 1: 1 for a disk or jar that the palm faces, near 0 for a can
    /// across the hand or anything long.
    pub(super) all_around: f32,
    /// Curvature under the contacts; flat if `thin` is below [`EVEN_SECTION`], where it does not matter.
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
        // Only a part as thick as wide can be a ball, so most need no closer look.
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

    /// Its diameter, in hand lengths, if it is as thick as wide: exact within 3 % for round and square rods.
    pub(super) fn diameter(&self) -> f32 {
        DIAMETER_PER_THICKNESS * self.thickness
    }
}

/// The point halfway between the contacts of the fingers and those of thumb and palm; `None` without a contact.
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

/// Widths in hand lengths over which objects cease to be small and begin to be medium: both fit well from 22 to 28 mm on an
/// adult's hand.
const NO_LONGER_SMALL: [f32; 2] = [0.115, 0.2];
const AT_LEAST_MEDIUM: [f32; 2] = [0.075, 0.15];

/// Widths in hand lengths over which objects cease to be medium and begin to be large: both fit well from 55 to 67 mm on an
/// adult's hand.
const NO_LONGER_MEDIUM: [f32; 2] = [0.29, 0.43];
const AT_LEAST_LARGE: [f32; 2] = [0.23, 0.35];

/// Width in hand lengths over which something becomes too wide for thumb and index finger: 38 to 66 mm on an adult's hand.
const PINCHABLE: [f32; 2] = [0.2, 0.35];

/// The same against the side of a finger: 23 to 42 mm on an adult's hand.
const BETWEEN_SIDES: [f32; 2] = [0.12, 0.22];

/// Width in hand lengths over which something becomes thick enough for a ring of thumb and index finger: 1 to 2.3 cm on an
/// adult's hand.
const RING: [f32; 2] = [0.05, 0.12];

/// Width in hand lengths over which something becomes too thick for a loop as on scissors: 3 to 6 cm on an adult's hand.
const LOOP: [f32; 2] = [0.15, 0.3];

/// Convergence of the outer fingers' pushes over which a prism becomes round.
const ROUND: [f32; 2] = [0.25, 0.7];

/// Sphericity over which a held part becomes a ball: 0.6 for a cube, 0.75 for a can as high as wide, over 0.9 for an apple.
const BALL: [f32; 2] = [0.76, 0.92];

/// Sphericity that convergent fingers add: a roundish object taken by its round side is taken as a ball.
const TAKEN_AS_BALL: f32 = 0.1;

/// [`Curvature::roundness`](crate::geometry::local_shape::Curvature::roundness) over which a touched part becomes round: more than
/// a square rod.
const ROUND_SECTION: [f32; 2] = [0.7, 0.85];

/// [`Curvature::along`](crate::geometry::local_shape::Curvature::along) over which a round part bulges like a ball or the bowl of
/// a glass: its outline curves with five to two and a half times the radius of its section.
const CURVED_ALONG: [f32; 2] = [0.2, 0.4];

/// Widths in hand lengths that fingertips feel as bulging: from 27 to 36 mm on an adult's hand, up to 11 to 14 cm.
const WIDE_ENOUGH: [f32; 2] = [0.14, 0.19];
const TOO_WIDE: [f32; 2] = [0.6, 0.75];

/// Degrees of bulging over which a part becomes a ball and ceases to be a prism. In between, people call it by either name.
const AT_LEAST_BULGING: [f32; 2] = [0.0, 0.7];
const NO_LONGER_PRISM: [f32; 2] = [0.3, 1.0];

/// [`HeldPart::compact`](super::held_part::HeldPart::compact) over which a fist, which feels more than fingertips do, holds
/// something that bulges as a ball.
const COMPACT_IN_FIST: [f32; 2] = [0.5, 0.75];

/// [`HeldPart::all_around`](super::held_part::HeldPart::all_around) over which a part that the palm faces becomes a disk.
const ALL_AROUND: [f32; 2] = [0.3, 0.6];

/// Thickness in hand lengths over which a sheet becomes a disk with a rim: 3 to 7 mm on an adult's hand.
const RIM: [f32; 2] = [0.016, 0.037];

/// Pull of the digits toward the palm over which they cease to hold a disk's rim and close around something.
const BEYOND_RIM: [f32; 2] = [0.2, 0.5];

/// [`HeldPart::thin`](super::held_part::HeldPart::thin) over which a plate becomes a bar: 0.25 for a phone, 0.45 for a bar three
/// times as wide as thick.
const BAR: [f32; 2] = [0.3, 0.55];

/// [`HeldPart::compact`](super::held_part::HeldPart::compact) over which something long becomes compact.
const COMPACT: [f32; 2] = [0.4, 0.65];

/// Fit of a type if the taxonomy shows it on another shape or size, but a hand can hold this one in the same way: a plate in a
/// fist, a card like a pen, a bar like a plate, a wide box in a pinch.
const OTHER_SHAPE: f32 = 0.6;

/// Fit of the held part to each shape, 0 to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShapeFits {
    pub(super) ball: f32,
    pub(super) ball_in_fist: f32,
    /// A disk, or the end of a cylinder, that the palm faces and the digits hold by its rim.
    pub(super) disk: f32,
    /// Something straight across the fingers: neither ball nor disk.
    pub(super) prismatic: f32,
    pub(super) compact: f32,
    /// Something that a hand wraps around: neither ball nor disk, and not flat.
    pub(super) bar: f32,
    pub(super) plate: f32,
    /// Something flat that stretched fingers lie along; in part, any prism.
    pub(super) flat: f32,
    pub(super) pen: f32,
    pub(super) stick: f32,
    pub(super) ring: f32,
    pub(super) loops: f32,
    pub(super) pinchable: f32,
    pub(super) between_sides: f32,
    pub(super) light: f32,
    pub(super) small: f32,
    pub(super) medium: f32,
    pub(super) large: f32,
}

impl ShapeFits {
    /// Combines the shape of the held part with where the digits touch it.
    pub(super) fn of(features: &Features) -> Self {
        let part = &features.part;
        let width = features.thickness;
        let small = falling(width, NO_LONGER_SMALL);
        let round = rising(features.convergence, ROUND);
        let whole_ball = rising(part.sphericity + TAKEN_AS_BALL * round, BALL);
        let bulge = bulge(part, width);
        let bulging = rising(bulge, AT_LEAST_BULGING);
        let ball = whole_ball.max(bulging);
        let ball_in_fist = whole_ball.max(bulging * rising(part.compact, COMPACT_IN_FIST));
        let rim = rising(part.all_around, ALL_AROUND) * rising(part.thickness, RIM);
        let disk = (1.0 - ball) * round * rim * falling(features.pull, BEYOND_RIM);
        let curved = ball.max(disk);
        let is_compact = rising(part.compact, COMPACT);
        let body = (1.0 - curved) * round * is_compact;
        let straight = (1.0 - whole_ball.max(disk)).min(falling(bulge, NO_LONGER_PRISM));
        let prismatic = straight - (1.0 - OTHER_SHAPE) * body;
        let thick = rising(part.thin, BAR);
        let bar = (1.0 - ball_in_fist.max(disk)) * at_least(OTHER_SHAPE, thick);
        let rod = thick * (1.0 - is_compact);
        let between_sides = (1.0 - ball) * falling(width, BETWEEN_SIDES);
        Self {
            ball,
            ball_in_fist,
            disk,
            prismatic,
            compact: curved + OTHER_SHAPE * body,
            bar,
            plate: 1.0 - thick,
            flat: prismatic * at_least(OTHER_SHAPE, 1.0 - thick),
            pen: between_sides * at_least(OTHER_SHAPE, rod),
            stick: at_least(OTHER_SHAPE, rod),
            ring: prismatic * at_least(OTHER_SHAPE, thick) * at_least(OTHER_SHAPE, rising(width, RING)),
            loops: prismatic * at_least(OTHER_SHAPE, falling(width, LOOP)),
            pinchable: at_least(OTHER_SHAPE, falling(width, PINCHABLE)),
            between_sides,
            light: at_least(OTHER_SHAPE, small),
            small,
            medium: rising(width, AT_LEAST_MEDIUM) * falling(width, NO_LONGER_MEDIUM),
            large: rising(width, AT_LEAST_LARGE),
        }
    }
}

/// Degree to which a part of some width is round and also curves along itself under the contacts, as the bowl of a glass does.
fn bulge(part: &HeldPart, width: f32) -> f32 {
    rising(part.curvature.roundness, ROUND_SECTION)
        * rising(part.curvature.along, CURVED_ALONG)
        * rising(part.thin, EVEN_SECTION)
        * rising(width, WIDE_ENOUGH)
        * falling(width, TOO_WIDE)
}

/// Maps 0 to `least`, 1 to 1.
fn at_least(least: f32, degree: f32) -> f32 {
    least + (1.0 - least) * degree
}

/// Smoothstep: 0 up to `from`, 1 above `to`.
pub(super) fn rising(x: f32, [from, to]: [f32; 2]) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The complement of [`rising`]: 1 up to the start of the range, 0 above its end.
pub(super) fn falling(x: f32, range: [f32; 2]) -> f32 {
    1.0 - rising(x, range)
}
