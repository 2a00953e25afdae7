//! Clearance and depth of a tapered capsule at a mesh.
//!
//! With d(t) the distance from the axis point a(t) to the surface, negative in the mesh's volume, and r(t) the radius
//! there, the clearance is the minimum of d(t) - r(t). Where the axis is outside, a negative clearance is how deep
//! the surface lies below the capsule's skin (for a thin sheet across a finger, the finger's radius there); where it
//! is inside, how far that part of the capsule would have to move to get out.

use glam::Vec3;

use super::TaperedCapsule;
use crate::geometry::{Segment, capsule_gap::CapsuleGap, mesh_bvh::MeshBvh};

/// Where a capsule comes closest to a mesh, or penetrates it deepest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// The point of the mesh.
    pub point: Vec3,
    /// The triangle it lies on.
    pub triangle: u32,
    /// The triangle's outward unit normal.
    pub normal: Vec3,
    /// Position on the axis: 0 is the capsule's start, 1 its end.
    pub along: f32,
    /// The clearance, in metres.
    pub clearance: f32,
}

/// Tolerance of depths where a capsule's axis is inside the volume, in metres. Such a capsule is several times deeper
/// than skin yields, so nothing depends on the rest; smaller values make hopeless hands expensive.
const DEEP_TOLERANCE: f32 = 1e-3;

/// Upper bound on the error of gaps, in metres.
const GAP_SLACK: f32 = 2e-5;

/// The clearance between a capsule and a mesh in metres, negative where they overlap, or `at_least` if it is larger.
/// Exact to 0.01 mm where the axis is outside the volume, else at most 1 mm short of the depth.
pub fn clearance(capsule: &TaperedCapsule, surface: &MeshBvh, at_least: f32) -> f32 {
    closest(capsule, surface, at_least).map_or(at_least, |touch| touch.clearance)
}

/// True if the clearance is less than `distance` metres; faster than computing it.
pub fn comes_within(capsule: &TaperedCapsule, surface: &MeshBvh, distance: f32) -> bool {
    surface.comes_within(capsule, distance) || surface.contains(capsule.start)
}

/// Where a capsule and a mesh come closest, if the [`clearance`] is at most `within` metres.
pub fn closest(capsule: &TaperedCapsule, surface: &MeshBvh, within: f32) -> Option<Touch> {
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
    nearest.map(|nearest| Touch {
        point: nearest.position,
        triangle: nearest.triangle,
        normal: surface.mesh().normal(nearest.triangle as usize),
        along: nearest.along,
        clearance: nearest.gap,
    })
}

/// Finds the deepest point of the axis in the volume by branch and bound on an interval of it: depth changes by no
/// more than the distance along the axis, the radius by its slope. The surface is within `reach` metres of the
/// interval's middle.
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
