//! How far a tapered capsule is from a mesh, and how deep in it.
//!
//! With d(t) the distance from the axis' point a(t) to the surface, negative in the mesh's volume, the clearance is the
//! least of d(t) - r(t). Where the axis is outside, a negative clearance is how deep the surface lies below the
//! capsule's skin (a thin sheet across a finger is as deep as the finger is thick there); where it is inside, how far
//! that part of the capsule would have to move to be out.

use glam::Vec3;

use super::TaperedCapsule;
use crate::geometry::{Segment, capsule_gap::CapsuleGap, mesh_bvh::MeshBvh};

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

/// How exact depths are where a capsule's axis is inside of the volume, in metres. Such a capsule is deeper than its
/// radius, several times what skin gives, so that nothing hangs on the rest; less makes hopeless hands expensive.
const DEEP_TOLERANCE: f32 = 1e-3;

/// More than what gaps may be too large by, in metres.
const GAP_SLACK: f32 = 2e-5;

/// The clearance between the surfaces of a capsule and a mesh in metres, negative where they overlap, or `at_least` if
/// it is more than that. To a hundredth of a millimetre where the axis is outside of the volume, else at most 1 mm short
/// of the depth.
pub fn clearance(capsule: &TaperedCapsule, surface: &MeshBvh, at_least: f32) -> f32 {
    closest(capsule, surface, at_least).map_or(at_least, |touch| touch.clearance)
}

/// True if the clearance is less than `distance` metres, found sooner than the clearance itself.
pub fn comes_within(capsule: &TaperedCapsule, surface: &MeshBvh, distance: f32) -> bool {
    surface.comes_within(capsule, distance) || surface.contains(capsule.start)
}

/// Where a capsule and a mesh come closest, if the clearance ([`clearance`]) is at most `within` metres.
pub fn closest(capsule: &TaperedCapsule, surface: &MeshBvh, within: f32) -> Option<Touch> {
    let gap = surface.closest_to_capsule(capsule, within);
    // The axis crosses the surface only where the gap is a radius.
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

/// Looks for the deepest point of the axis in the volume, by branch and bound over a part of it: the depth changes by
/// no more than the way along the axis, the radius by its slope. The surface is within `reach` metres of the part's
/// middle.
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
    // Inside, the depth may grow with the way; outside, it only begins where the surface is.
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
        // From half the way on, the surface is no farther than that and this distance.
        let reach = closest.distance + change;
        deepen(capsule, surface, [from, along], reach, least, nearest);
        deepen(capsule, surface, [along, to], reach, least, nearest);
    }
}
