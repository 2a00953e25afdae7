//! How far a tapered capsule is from a mesh, and how deep in it.
//!
//! With d(t) the distance from the axis' point a(t) to the surface, negative in the mesh's volume, the clearance is the
//! least of d(t) - r(t). Where the axis is outside, a negative clearance is how deep the surface lies below the
//! capsule's skin (a thin sheet across a finger is as deep as the finger is thick there); where it is inside, how far
//! that part of the capsule would have to move to be out.

use glam::Vec3;

use super::TaperedCapsule;
use crate::geometry::mesh_bvh::MeshBvh;

/// Where a capsule comes closest to a mesh, or goes deepest into it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// The point of the mesh.
    pub point: Vec3,
    /// The triangle it lies on.
    pub triangle: u32,
    /// The triangle's outward unit normal.
    pub normal: Vec3,
    /// The point of the axis that is closest: 0 is the capsule's start, 1 its end.
    pub along: f32,
    /// The clearance, in metres.
    pub clearance: f32,
}

/// How exact clearances are, in metres: far below the 2 mm that a hand may sink into an object.
const TOLERANCE: f32 = 1e-4;

/// The clearance between the surfaces of a capsule and a mesh in metres, negative where they overlap, or `at_least` if
/// it is certainly more than that.
pub fn clearance(capsule: &TaperedCapsule, surface: &MeshBvh, at_least: f32) -> f32 {
    closest(capsule, surface, at_least).map_or(at_least, |touch| touch.clearance)
}

/// Where a capsule and a mesh come closest, if that is at most `within` metres.
pub fn closest(capsule: &TaperedCapsule, surface: &MeshBvh, within: f32) -> Option<Touch> {
    let mut best = within;
    let mut touch = None;
    narrow(capsule, surface, 0.0, 1.0, &mut best, &mut touch);
    touch
}

/// Branch and bound over a part of the axis.
fn narrow(
    capsule: &TaperedCapsule,
    surface: &MeshBvh,
    from: f32,
    to: f32,
    best: &mut f32,
    touch: &mut Option<Touch>,
) {
    let along = 0.5 * (from + to);
    let half = 0.5 * (to - from);
    // d changes by no more than the way, r by its slope.
    let change = half * (capsule.length() + (capsule.end_radius - capsule.start_radius).abs());
    let point = capsule.at(along);
    let radius = capsule.radius_at(along);
    let is_inside = surface.contains(point);
    let reach = if is_inside {
        f32::INFINITY
    } else {
        *best + radius + change
    };
    let Some(closest) = surface.closest_point_within(point, reach) else {
        return;
    };
    let distance = if is_inside {
        -closest.distance
    } else {
        closest.distance
    };
    let clearance = distance - radius;
    if clearance <= *best {
        *best = clearance;
        *touch = Some(Touch {
            point: closest.position,
            triangle: closest.triangle,
            normal: surface.mesh().normal(closest.triangle as usize),
            along,
            clearance,
        });
    }
    if clearance - change < *best && change > TOLERANCE {
        narrow(capsule, surface, from, along, best, touch);
        narrow(capsule, surface, along, to, best, touch);
    }
}
