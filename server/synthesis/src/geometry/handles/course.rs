//! How a slender part goes on from a place inside it: along its bends, until it ends or meets the rest of the object.

use glam::Vec3;

use super::RAY_LENGTH;
use crate::geometry::{Segment, mesh_bvh::MeshBvh};

/// Length of a step along the part, in metres, and the largest number of steps to either side: half the breadth of a hand.
const STEP: f32 = 0.008;
const MAX_STEPS: usize = 7;

/// Directions around the part in which its skin is found at each step.
const SIDES: usize = 4;

/// Queries of the surface by both walks of a course, at most.
pub(super) const QUERIES: usize = 2 * (MAX_STEPS * (SIDES + 1) + SIDES);

/// Smallest cosine of the turn between two steps: 40°, as in the ear of a small cup.
const MIN_COS: f32 = 0.77;

/// How many times as thick as at its start a part may get: more is what it is attached to.
const MAX_GROWTH: f32 = 1.7;

/// Distance aside of the end of a part, in radii, at which there is nothing around a free end, and how near the rest of the object
/// is there at an attached one. Fewest sides on which it is.
const ASIDE: f32 = 2.5;
const NEAR: f32 = 1.5;
const ATTACHED_SIDES: usize = 3;

/// How far a part goes on to both sides of a place, in metres, and whether it meets the rest of the object there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Course {
    pub(super) lengths: [f32; 2],
    pub(super) is_attached: [bool; 2],
}

impl Course {
    /// Of a part with this axis and mean radius around a point inside it.
    pub(super) fn of(surface: &MeshBvh, middle: Vec3, axis: Vec3, radius: f32) -> Self {
        let walks = [axis, -axis].map(|direction| walk(surface, middle, direction, radius));
        Self {
            lengths: walks.map(|(length, _)| length),
            is_attached: walks.map(|(_, is_attached)| is_attached),
        }
    }

    /// Both sides together, in metres.
    pub(super) fn length(&self) -> f32 {
        self.lengths.into_iter().sum()
    }
}

/// How far the part goes on in one direction, and whether it is attached there.
fn walk(surface: &MeshBvh, middle: Vec3, direction: Vec3, radius: f32) -> (f32, bool) {
    let (mut at, mut direction) = (middle, direction);
    let mut length = 0.0;
    for _ in 0..MAX_STEPS {
        let ahead = at + direction * STEP;
        if let Some(hit) = surface.first_hit(Segment::new(at, ahead)) {
            return (
                length + hit.distance,
                is_attached_at(surface, hit.position, direction, radius),
            );
        }
        let Some(next) = middle_at(surface, ahead, direction, MAX_GROWTH * radius) else {
            return (length + STEP, true);
        };
        let way = next - at;
        let turned = way.normalize_or(direction);
        if turned.dot(direction) < MIN_COS {
            return (length, true);
        }
        length += way.length();
        (at, direction) = (next, turned);
    }
    (length, false)
}

/// The middle of the part's section; `None` if its skin is farther than `most` metres on a side.
fn middle_at(surface: &MeshBvh, inside: Vec3, direction: Vec3, most: f32) -> Option<Vec3> {
    let mut skins = Vec3::ZERO;
    for aside in sides(direction) {
        let ray = Segment::new(inside, inside + aside * RAY_LENGTH);
        skins += surface.first_hit(ray)?.position / SIDES as f32;
    }
    let radii = sides(direction).map(|aside| {
        let ray = Segment::new(skins, skins + aside * RAY_LENGTH);
        surface.first_hit(ray).map_or(RAY_LENGTH, |hit| hit.distance)
    });
    let mean = radii.into_iter().sum::<f32>() / SIDES as f32;
    (mean <= most).then_some(skins)
}

/// True if the rest of the object is around the end of a part.
fn is_attached_at(surface: &MeshBvh, end: Vec3, direction: Vec3, radius: f32) -> bool {
    let near = sides(direction).map(|aside| {
        let beside = end + aside * (ASIDE * radius);
        surface.closest_point_within(beside, NEAR * radius).is_some()
    });
    near.into_iter().filter(|&is_near| is_near).count() >= ATTACHED_SIDES
}

/// Unit vectors at right angles to a direction.
fn sides(direction: Vec3) -> [Vec3; SIDES] {
    let (a, b) = direction.any_orthonormal_pair();
    [a, b, -a, -b]
}
