//! Clearances of a hand from itself and of a tapered capsule from a mesh.
//!
//! With d(t) the distance from the axis point a(t) to the surface, negative in the mesh's volume, and r(t) the radius
//! there, the clearance is the minimum of d(t) - r(t). Where the axis is outside, a negative clearance is how deep
//! the surface lies below the capsule's skin; where it is inside, how far that part of the capsule would have to move to get out.

use glam::Vec3;

use super::{HandSolids, PALM_SOLIDS, SolidPart, THENAR_SOLIDS, TaperedCapsule};
use crate::{
    geometry::{Segment, capsule_gap::CapsuleGap, mesh_bvh::MeshBvh},
    model::hand::{
        Digit, HandPose, Phalanx,
        rig::{PALM_PART, RestOverlaps, Rig, THUMB_BALL_PART},
    },
};

/// How far two parts of a hand may press into each other before one counts as going through the other, in metres:
/// neighbouring fingers touch in life, and both yield by a millimetre under little force. Larger values let fingers
/// visibly overlap, smaller ones reject ordinary closed hands.
pub const SOFT_CONTACT: f32 = 0.002;

/// Bound on the ratio of a first phalanx's radii: the tracked radius of a knuckle includes flesh that neighbours share.
const KNUCKLE_TAPER: f32 = 1.03;

/// The smallest distance in metres between parts of a rig's hand that can meet, plus [`SOFT_CONTACT`], which soft flesh allows,
/// and their overlap at rest: negative if a part goes through another, [`SOFT_CONTACT`] if none touch.
///
/// The parts that can meet are the links of different digits, the two outer links of a digit and the palm, and, for
/// fingers, the ball of the thumb. Inner links and the thumb's ball overlap the palm in every pose.
pub fn self_clearance(rig: &Rig, hand: &HandSolids) -> f32 {
    let parts = Parts::of(hand);
    // Without overlaps, nothing is looked up.
    let least = match rig.rest_overlaps.as_deref() {
        None => parts.least_distance(0.0, |_, _| 0.0, |_, _| ()),
        Some(overlaps) => parts.least_distance(0.0, |link, part| overlaps.of(link, part), |_, _| ()),
    };
    least + SOFT_CONTACT
}

/// The two parts of a hand that can meet and come closest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NearestParts {
    /// [`self_clearance`] of them, at any distance.
    pub clearance: f32,
    /// How deep they overlap at rest, in metres.
    pub rest_overlap: f32,
    /// The parts with their solids.
    pub parts: [(SolidPart, TaperedCapsule); 2],
}

impl NearestParts {
    /// The closest parts of a rig's hand; `None` if no parts can meet.
    pub(crate) fn of(rig: &Rig, hand: &HandSolids) -> Option<Self> {
        let overlap = |link, part| {
            let overlaps = rig.rest_overlaps.as_deref();
            overlaps.map_or(0.0, |overlaps| overlaps.of(link, part))
        };
        let parts = Parts::of(hand);
        let mut nearest = None;
        let least = parts.least_distance(f32::INFINITY, overlap, |[ours, theirs], solids| {
            nearest = Some((ours, theirs, solids));
        });
        nearest.map(|(link, part, [our, their])| Self {
            clearance: least + SOFT_CONTACT,
            rest_overlap: overlap(link, part),
            parts: [(solid_part(link), our), (solid_part(part), their)],
        })
    }
}

/// The largest overlap of each pair of a rig's parts in some poses; `None` if no parts overlap.
pub fn rest_overlaps(rig: &Rig, poses: &[HandPose]) -> Option<Box<RestOverlaps>> {
    let mut overlaps = RestOverlaps::default();
    for pose in poses {
        let parts = Parts::of(&HandSolids::of_pose(rig, pose));
        parts.for_each_pair(|[link, part], [our, their]| {
            overlaps.deepen(link, part, -our.solid.distance(&their.solid));
        });
    }
    (overlaps != RestOverlaps::default()).then(|| Box::new(overlaps))
}

/// The part with an index of [`RestOverlaps`].
fn solid_part(part: usize) -> SolidPart {
    match part {
        PALM_PART => SolidPart::Palm,
        THUMB_BALL_PART => SolidPart::ThumbBall,
        link => SolidPart::Phalanx(Digit::ALL[link / 3], Phalanx::ALL[link % 3]),
    }
}

/// The parts of a hand that can meet others.
struct Parts {
    digits: [[Bounded; 3]; 5],
    palm: [Bounded; PALM_SOLIDS],
    thenar: [Bounded; THENAR_SOLIDS],
}

impl Parts {
    #[inline]
    fn of(hand: &HandSolids) -> Self {
        let mut phalanges = hand.phalanges;
        for [first, ..] in &mut phalanges[1..] {
            first.start_radius = first.start_radius.min(first.end_radius * KNUCKLE_TAPER);
        }
        Self {
            digits: phalanges.map(|links| links.map(Bounded::new)),
            palm: hand.palm.map(Bounded::new),
            thenar: hand.thenar.map(Bounded::new),
        }
    }

    /// Visits the pairs that can meet: the indices of [`RestOverlaps`], of which the first is a link, and the solids.
    #[inline]
    fn for_each_pair(&self, mut visit: impl FnMut([usize; 2], [&Bounded; 2])) {
        let Self { digits, palm, thenar } = self;
        // Missing digits are a point in the palm.
        let is_there = |digit: &[Bounded; 3]| digit[2].solid.end_radius > 0.0;
        for (i, digit) in digits.iter().enumerate().filter(|(_, digit)| is_there(digit)) {
            let others = digits.iter().enumerate().skip(i + 1);
            for (j, other) in others.filter(|(_, other)| is_there(other)) {
                for (our_link, our) in digit.iter().enumerate() {
                    for (their_link, their) in other.iter().enumerate() {
                        visit([3 * i + our_link, 3 * j + their_link], [our, their]);
                    }
                }
            }
        }
        for (i, digit) in digits.iter().enumerate().filter(|(_, digit)| is_there(digit)) {
            let of_hand = [(PALM_PART, palm.as_slice()), (THUMB_BALL_PART, thenar.as_slice())];
            let meetable = of_hand
                .into_iter()
                .filter(|&(part, _)| i > 0 || part == PALM_PART);
            for (part, solids) in meetable {
                for (link, our) in digit.iter().enumerate().skip(1) {
                    for their in solids {
                        visit([3 * i + link, part], [our, their]);
                    }
                }
            }
        }
    }

    /// The smallest distance between parts that can meet plus overlap at rest, up to `enough`; `nearer` receives each closer pair.
    #[inline]
    fn least_distance(
        &self,
        enough: f32,
        overlap: impl Fn(usize, usize) -> f32,
        mut nearer: impl FnMut([usize; 2], [TaperedCapsule; 2]),
    ) -> f32 {
        let mut least = enough;
        self.for_each_pair(|[link, part], [our, their]| {
            let overlap = overlap(link, part);
            if our.is_beyond(their, least - overlap) {
                return;
            }
            let distance = our.solid.distance(&their.solid) + overlap;
            if distance < least {
                least = distance;
                nearer([link, part], [our.solid, their.solid]);
            }
        });
        least
    }
}

/// A solid with its bounding sphere.
#[derive(Clone, Copy, Debug)]
pub struct Bounded {
    pub(in crate::physical) solid: TaperedCapsule,
    pub(in crate::physical) centre: Vec3,
    pub(in crate::physical) radius: f32,
}

impl Bounded {
    pub(in crate::physical) fn new(solid: TaperedCapsule) -> Self {
        let (centre, radius) = solid.bounding_sphere();
        Self {
            solid,
            centre,
            radius,
        }
    }

    /// A lower bound on the distance in metres, by the same tests as [`Bounded::is_beyond`].
    pub(in crate::physical) fn distance_lower_bound(&self, other: &Self) -> f32 {
        let by_spheres = self.centre.distance(other.centre) - self.radius - other.radius;
        let (long, round) = self.longer_first(other);
        let by_axis = long.distance_squared_from_axis(round.centre).sqrt() - long.thickest() - round.radius;
        by_spheres.max(by_axis)
    }

    /// True if the other is certainly farther away than `distance`, by the bounding spheres and the longer solid's axis.
    pub(in crate::physical) fn is_beyond(&self, other: &Self, distance: f32) -> bool {
        let reach = distance + self.radius + other.radius;
        if reach < 0.0 || self.centre.distance_squared(other.centre) > reach * reach {
            return true;
        }
        let (long, round) = self.longer_first(other);
        let reach = distance + long.thickest() + round.radius;
        reach < 0.0 || long.distance_squared_from_axis(round.centre) > reach * reach
    }

    fn longer_first<'a>(&'a self, other: &'a Self) -> (&'a Self, &'a Self) {
        if self.radius > other.radius {
            (self, other)
        } else {
            (other, self)
        }
    }

    fn thickest(&self) -> f32 {
        self.solid.start_radius.max(self.solid.end_radius)
    }

    fn distance_squared_from_axis(&self, point: Vec3) -> f32 {
        let axis = self.solid.end - self.solid.start;
        let offset = point - self.solid.start;
        let along = (offset.dot(axis) / axis.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        offset.distance_squared(axis * along)
    }
}

/// Tolerance of depths where a capsule's axis is inside the volume, in metres.
const DEEP_TOLERANCE: f32 = 1e-3;

/// Upper bound on the error of gaps, in metres.
const GAP_SLACK: f32 = 2e-5;

/// The clearance between a capsule and a mesh in metres, negative where they overlap, or `at_least` if it is larger.
/// Exact to 0.01 mm where the axis is outside the volume, else at most 1 mm short of the depth.
pub fn clearance(capsule: &TaperedCapsule, surface: &MeshBvh, at_least: f32) -> f32 {
    closest(capsule, surface, at_least).map_or(at_least, |touch| touch.gap)
}

/// True if the clearance is less than `distance` metres; faster than computing it.
pub fn comes_within(capsule: &TaperedCapsule, surface: &MeshBvh, distance: f32) -> bool {
    surface.comes_within(capsule, distance) || surface.contains(capsule.start)
}

/// Where a capsule and a mesh come closest, if the [`clearance`] is at most `within` metres.
pub fn closest(capsule: &TaperedCapsule, surface: &MeshBvh, within: f32) -> Option<CapsuleGap> {
    let gap = surface.closest_to_capsule(capsule, within);
    // The axis crosses the surface only where the gap is minus a radius.
    let crossing = GAP_SLACK - capsule.start_radius.min(capsule.end_radius);
    let may_cross = gap.is_some_and(|gap| gap.gap <= crossing);
    let axis = Segment::new(capsule.start, capsule.end);
    let mut nearest = gap;
    if may_cross && surface.is_crossed_by(axis) || surface.contains(axis.start) {
        let mut least = gap.map_or(within, |gap| gap.gap);
        deepen(
            capsule,
            surface,
            [0.0, 1.0],
            f32::INFINITY,
            &mut least,
            &mut nearest,
        );
    }
    nearest
}

/// Finds the deepest point of an axis interval by branch and bound; the surface is within `reach` metres of its middle.
fn deepen(
    capsule: &TaperedCapsule,
    surface: &MeshBvh,
    [from, to]: [f32; 2],
    reach: f32,
    least: &mut f32,
    nearest: &mut Option<CapsuleGap>,
) {
    let along = 0.5 * (from + to);
    let change = 0.5 * (to - from) * (capsule.length() + (capsule.end_radius - capsule.start_radius).abs());
    let (point, radius) = (capsule.at(along), capsule.radius_at(along));
    let Some(closest) = surface.closest_point_within(point, reach) else {
        return;
    };
    // Inside, depth can grow with the distance; outside, it starts only at the surface.
    let depth = if surface.contains(point) {
        let gap = -closest.distance - radius;
        if gap <= *least {
            *least = gap;
            *nearest = Some(CapsuleGap {
                position: closest.position,
                triangle: closest.triangle,
                along,
                gap,
            });
        }
        closest.distance
    } else if closest.distance > change {
        return;
    } else {
        -closest.distance
    };
    let deepest = -radius - depth - change;
    if deepest < *least - DEEP_TOLERANCE && change > DEEP_TOLERANCE {
        // From the middle of either half, the surface is no farther than this.
        let reach = closest.distance + change;
        deepen(capsule, surface, [from, along], reach, least, nearest);
        deepen(capsule, surface, [along, to], reach, least, nearest);
    }
}
