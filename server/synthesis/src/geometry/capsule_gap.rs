//! The gap between a tapered capsule and a surface, by branch and bound over four boxes or four triangles at a time.
//!
//! Let D(t) be the distance from the point a(t) of the capsule's axis to a convex set. D is convex, and the gap to the
//! set is the minimum of D(t) - r(t) for t from 0 to 1. For boxes, tangents of D - r give a lower bound; for triangles,
//! the minimum is one of a few values in closed form.

use glam::{Vec3, Vec4};

use super::{
    closest::{closest_on_triangle, pack_distances},
    crossing::{cross, dot, minus, point_along, splat},
    mesh::TriangleMesh,
    tapered_capsule::TaperedCapsule,
    wide_bvh::{Node, TrianglePack, WideBvh},
};

/// Slack of the lower bounds, in metres: exceeds all rounding for coordinates up to a metre.
const SLACK: f32 = 1e-6;

/// How much closer a triangle must be to replace the closest so far, in metres: the accuracy of the result.
const ACCURACY: f32 = 1e-5;

/// Floor of determinants of two directions before division, in m⁴: positive, and below that of two perpendicular micrometres.
const MIN_DETERMINANT: f32 = 1e-30;

/// Where a mesh's surface comes closest to a capsule's skin or penetrates it deepest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CapsuleGap {
    /// The point of the mesh, in metres.
    pub position: Vec3,
    /// The triangle it lies on.
    pub triangle: u32,
    /// Axis parameter of the capsule's closest sphere, from 0 (start) to 1 (end).
    pub along: f32,
    /// Distance from the capsule's skin to the point, in metres; negative below the skin.
    pub gap: f32,
}

/// Three coordinates of four points.
type Four = [Vec4; 3];

/// A capsule prepared for the four-lane formulas.
struct Query {
    start: Four,
    end: Four,
    /// From start to end.
    axis: Four,
    /// Its squared length.
    squared_length: Vec4,
    start_radius: Vec4,
    end_radius: Vec4,
    /// From the start's radius to the end's.
    rise: Vec4,
    /// A point at `x` along the axis and `y` perpendicular to it is closest to the sphere at
    /// t = `foot` + (x + y `lean`) / length.
    foot: Vec4,
    direction: Four,
    lean: Vec4,
    inverse_length: Vec4,
    /// In metres; added to a gap, it makes it non-negative, as stack entries require.
    largest_radius: f32,
}

impl Query {
    fn new(capsule: &TaperedCapsule) -> Self {
        let axis = capsule.end - capsule.start;
        let length = axis.length();
        let rise = capsule.end_radius - capsule.start_radius;
        let slope = rise / length;
        // If one sphere contains the other, it is the whole solid.
        let is_one_sphere = slope.is_nan() || slope.abs() >= 1.0;
        let (foot, direction, lean, inverse_length) = if is_one_sphere {
            (if rise > 0.0 { 1.0 } else { 0.0 }, Vec3::ZERO, 0.0, 0.0)
        } else {
            (
                0.0,
                axis / length,
                slope / (1.0 - slope * slope).sqrt(),
                length.recip(),
            )
        };
        Self {
            start: splat(capsule.start),
            end: splat(capsule.end),
            axis: splat(axis),
            squared_length: Vec4::splat(axis.length_squared()),
            start_radius: Vec4::splat(capsule.start_radius),
            end_radius: Vec4::splat(capsule.end_radius),
            rise: Vec4::splat(rise),
            foot: Vec4::splat(foot),
            direction: splat(direction),
            lean: Vec4::splat(lean),
            inverse_length: Vec4::splat(inverse_length),
            largest_radius: capsule.start_radius.max(capsule.end_radius),
        }
    }

    fn radius_at(&self, t: Vec4) -> Vec4 {
        self.start_radius + self.rise * t
    }
}

/// True if any triangle is closer than `distance` metres to the capsule's skin.
pub(super) fn is_within(bvh: &WideBvh, capsule: &TaperedCapsule, distance: f32) -> bool {
    let mut is_within = false;
    descend(bvh, &Query::new(capsule), distance, |_, _| {
        is_within = true;
        f32::NEG_INFINITY
    });
    is_within
}

/// Visits triangles with gaps below a limit, roughly closest first. `found` returns the new limit.
#[inline]
fn descend(bvh: &WideBvh, query: &Query, limit: f32, found: impl FnMut(f32, u32) -> f32) {
    bvh.visit_nearest(
        limit,
        query.largest_radius,
        |node| box_gaps(node, query),
        |pack| pack_gaps(pack, query),
        || true,
        found,
    );
}

/// Where the surface is closest to the capsule's skin, within [`ACCURACY`]; `None` if the gap exceeds `within` metres.
pub(super) fn closest(
    bvh: &WideBvh,
    mesh: &TriangleMesh,
    capsule: &TaperedCapsule,
    within: f32,
) -> Option<CapsuleGap> {
    let mut winner = None;
    descend(bvh, &Query::new(capsule), within + SLACK, |gap, triangle| {
        winner = Some(triangle);
        gap - ACCURACY
    });
    let triangle = winner?;
    let along = nearest_on_axis(capsule, mesh.corners(triangle as usize));
    let on_axis = capsule.start.as_dvec3() + (capsule.end - capsule.start).as_dvec3() * along;
    let position = closest_on_triangle(mesh.corners(triangle as usize), on_axis);
    let radius = f64::from(capsule.start_radius) * (1.0 - along) + f64::from(capsule.end_radius) * along;
    let gap = (position.distance(on_axis) - radius) as f32;
    (gap <= within).then_some(CapsuleGap {
        position: position.as_vec3(),
        triangle,
        along: along as f32,
        gap,
    })
}

/// Lower bounds of the gaps to the boxes of a node's children; NaN, which is below no limit, for unused children.
#[inline]
fn box_gaps(node: &Node, query: &Query) -> Vec4 {
    let [min, max] = &node.bounds;
    // D(t) - r(t) and its slope.
    let tangent = |t: Vec4| {
        let mut squared = Vec4::ZERO;
        let mut falling = Vec4::ZERO;
        for axis in 0..3 {
            let point = query.start[axis] + query.axis[axis] * t;
            let below = (min[axis] - point).max(Vec4::ZERO);
            let above = (point - max[axis]).max(Vec4::ZERO);
            // At most one of the two is positive, except for unused children.
            let outside = above.max(below);
            squared += outside * outside;
            falling += (above - below) * query.axis[axis];
        }
        let distance = squared.max(Vec4::splat(f32::MIN_POSITIVE)).sqrt();
        (distance - query.radius_at(t), falling / distance - query.rise)
    };
    let (value0, slope0) = tangent(Vec4::ZERO);
    let (value1, slope1) = tangent(Vec4::ONE);
    // The end tangents meet near the minimum; a third tangent there raises the bound to where it meets one of them.
    let between = Vec4::select(
        slope0.cmplt(Vec4::ZERO) & slope1.cmpgt(Vec4::ZERO),
        ((value1 - slope1 - value0) / (slope0 - slope1))
            .max(Vec4::ZERO)
            .min(Vec4::ONE),
        Vec4::ZERO,
    );
    let (value, slope) = tangent(between);
    let rises = slope.cmpgt(Vec4::ZERO);
    let (t, other_value, other_slope, other_t) = (
        between,
        Vec4::select(rises, value0, value1),
        Vec4::select(rises, slope0, slope1),
        Vec4::select(rises, Vec4::ZERO, Vec4::ONE),
    );
    let meet = ((other_value - other_slope * other_t) - (value - slope * t)) / (slope - other_slope);
    let lowest = value + slope * (meet - t);
    let bound = Vec4::select(
        slope0.cmpge(Vec4::ZERO),
        value0,
        Vec4::select(slope1.cmple(Vec4::ZERO), value1, lowest),
    );
    let used = min[0].cmplt(max[0]) | min[0].cmpeq(max[0]);
    Vec4::select(used, bound - SLACK, Vec4::NAN)
}

/// Gaps to the triangles of a pack; NaN for unused lanes. The minimum lies at an end of the axis, at a corner, at an edge's
/// stationary point, or where the axis crosses the triangle; over the interior of the face, the distance is linear.
#[inline]
fn pack_gaps(pack: &TrianglePack, query: &Query) -> Vec4 {
    let first = minus(&query.start, &pack.corner);
    let second = minus(&first, &pack.edge1);
    let third = minus(&first, &pack.edge2);
    let edge3 = minus(&pack.edge2, &pack.edge1);

    let at_start = pack_distances(pack, &query.start).sqrt() - query.start_radius;
    let at_end = pack_distances(pack, &query.end).sqrt() - query.end_radius;
    let corners = corner_gap(query, &first)
        .min(corner_gap(query, &second))
        .min(corner_gap(query, &third));
    let edges = edge_gap(query, &first, &pack.edge1)
        .min(edge_gap(query, &first, &pack.edge2))
        .min(edge_gap(query, &second, &edge3));
    let around = at_start.min(at_end).min(corners).min(edges);

    let height = dot(&pack.normal, &first);
    let climb = dot(&pack.normal, &query.axis);
    let t = -height / climb;
    let crossing = point_along(&first, &query.axis, t);
    let around_first = cross(&crossing, &pack.normal);
    let around_second = cross(&minus(&crossing, &pack.edge1), &pack.normal);
    let smallest_side = dot(&pack.edge1, &around_first)
        .min(-dot(&pack.edge2, &around_first))
        .min(dot(&edge3, &around_second));
    let crosses = smallest_side.cmpge(Vec4::ZERO)
        & (height * (height + climb)).cmple(Vec4::ZERO)
        & climb.cmpne(Vec4::ZERO);
    Vec4::select(crosses, around.min(-query.radius_at(t)), around)
}

/// Gap to a corner; `start` is the capsule's start relative to the corner.
#[inline]
fn corner_gap(query: &Query, start: &Four) -> Vec4 {
    let along = -dot(start, &query.direction);
    let across = point_along(start, &query.direction, along);
    let across = dot(&across, &across).sqrt();
    let t = query.foot + (along + across * query.lean) * query.inverse_length;
    let t = t.max(Vec4::ZERO).min(Vec4::ONE);
    let offset = point_along(start, &query.axis, t);
    dot(&offset, &offset).sqrt() - query.radius_at(t)
}

/// Gap to an edge at its stationary point; `start` is the capsule's start relative to the edge's first corner.
#[inline]
fn edge_gap(query: &Query, start: &Four, edge: &Four) -> Vec4 {
    let (aa, ab, bb) = (query.squared_length, dot(&query.axis, edge), dot(edge, edge));
    let normal = cross(&query.axis, edge);
    let determinant = dot(&normal, &normal).max(Vec4::splat(MIN_DETERMINANT));
    // As in `TaperedCapsule::distance`, with the edge as a capsule of radius 0.
    let rest = (determinant - query.rise * query.rise * bb).max(Vec4::splat(MIN_DETERMINANT));
    let height = dot(start, &normal);
    let distance = (height * height / rest).sqrt();
    let along_axis = query.rise * distance - dot(start, &query.axis);
    let along_edge = -dot(start, edge);
    let t = ((along_axis * bb - along_edge * ab) / determinant)
        .max(Vec4::ZERO)
        .min(Vec4::ONE);
    let u = ((along_axis * ab - along_edge * aa) / determinant)
        .max(Vec4::ZERO)
        .min(Vec4::ONE);
    let offset = minus(
        &point_along(start, &query.axis, t),
        &[edge[0] * u, edge[1] * u, edge[2] * u],
    );
    dot(&offset, &offset).sqrt() - query.radius_at(t)
}

/// Axis parameter at which the gap to a triangle is smallest, in double precision.
fn nearest_on_axis(capsule: &TaperedCapsule, triangle: [Vec3; 3]) -> f64 {
    let corners = triangle.map(Vec3::as_dvec3);
    let start = capsule.start.as_dvec3();
    let axis = capsule.end.as_dvec3() - start;
    let radius = |t: f64| {
        f64::from(capsule.start_radius)
            + (f64::from(capsule.end_radius) - f64::from(capsule.start_radius)) * t
    };
    let mut best = (0.0, f64::INFINITY);
    let mut consider = |t: f64, gap: f64| {
        if gap < best.1 {
            best = (t, gap);
        }
    };
    for t in [0.0, 1.0] {
        let point = start + axis * t;
        let closest = closest_on_triangle(triangle, point);
        consider(t, closest.distance(point) - radius(t));
    }
    for (corner, next) in [(0, 1), (1, 2), (2, 0)] {
        let (t, gap) = capsule.nearest(corners[corner]);
        consider(t, gap);
        let edge = corners[next] - corners[corner];
        if let Some((t, gap)) = capsule.stationary(corners[corner], edge, 0.0, 0.0) {
            consider(t, gap);
        }
    }
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let t = (corners[0] - start).dot(normal) / axis.dot(normal);
    if (0.0..=1.0).contains(&t) {
        let point = start + axis * t;
        let is_inside = (0..3).all(|i| {
            let edge = corners[(i + 1) % 3] - corners[i];
            edge.cross(point - corners[i]).dot(normal) >= 0.0
        });
        if is_inside {
            consider(t, -radius(t));
        }
    }
    best.0
}
