//! The closest point of a surface, by branch and bound over four boxes or four triangles at a time.

use glam::{DVec3, Vec3, Vec4};

use super::{
    Segment,
    boxes::Aabb,
    crossing::{ExactQuery, cross, dot, minus, splat},
    mesh::TriangleMesh,
    tapered_capsule::TaperedCapsule,
    wide_bvh::{Node, TrianglePack, WideBvh, lanes},
};

/// Factor on squared distances to boxes: covers a few roundings, so that rounding never excludes a box.
const BOX_SLACK: f32 = 1.0 - 8.0 * f32::EPSILON;

/// Factor on the distance limit for the mesh's box, for the same reason.
const AABB_SLACK: f32 = 1.0 + 8.0 * f32::EPSILON;

/// True if nothing inside the box can be within `max_distance` metres of the point.
#[inline]
pub(super) fn is_beyond(aabb: &Aabb, point: Vec3, max_distance: f32) -> bool {
    aabb.distance(point) > max_distance * AABB_SLACK
}

/// A search that took too long.
#[derive(Clone, Copy, Debug)]
pub(super) struct GivenUp;

/// The triangle closest to a point, the closest point on it and its distance; `None` beyond `max_distance` metres. Gives up once
/// `may_go_on`, called for each node and each pack of triangles, returns false.
// Not inlined: far points return early and must not pay for the stack.
#[inline(never)]
pub(super) fn closest(
    bvh: &WideBvh,
    mesh: &TriangleMesh,
    point: Vec3,
    max_distance: f32,
    may_go_on: impl FnMut() -> bool,
) -> Result<Option<(u32, Vec3, f32)>, GivenUp> {
    if !(point.is_finite() && max_distance >= 0.0) {
        return Ok(None);
    }
    let four = splat(point);
    // Slightly above the limit; the last step compares exactly.
    let limit = (max_distance * max_distance).max(f32::MIN_POSITIVE) / (BOX_SLACK * BOX_SLACK);
    let mut winner = None;
    let is_complete = bvh.visit_nearest(
        limit,
        0.0,
        |node| box_distances(node, &four),
        |pack| pack_distances(pack, &four),
        may_go_on,
        |squared, triangle| {
            winner = Some(triangle);
            squared
        },
    );
    if !is_complete {
        return Err(GivenUp);
    }
    let Some(triangle) = winner else { return Ok(None) };
    let exact = closest_on_triangle(mesh.corners(triangle as usize), point.as_dvec3());
    let distance = exact.distance(point.as_dvec3());
    let is_within = distance <= f64::from(max_distance);
    Ok(is_within.then_some((triangle, exact.as_vec3(), distance as f32)))
}

/// Calls `visit` with every triangle within some distance of a point, in metres.
pub(super) fn each_within(bvh: &WideBvh, point: Vec3, distance: f32, mut visit: impl FnMut(u32)) {
    let four = splat(point);
    let most = Vec4::splat(distance * distance);
    bvh.visit(
        |node| box_distances(node, &four).cmple(most).bitmask(),
        |pack| {
            let near = pack_distances(pack, &four).cmple(most).bitmask();
            lanes(near).for_each(|lane| visit(pack.triangle(lane)));
            true
        },
    );
}

/// Squared distances to the boxes of a node's children, reduced by [`BOX_SLACK`]; 0 inside, ∞ for unused children.
#[inline]
fn box_distances(node: &Node, point: &[Vec4; 3]) -> Vec4 {
    let [min, max] = &node.bounds;
    let (below, above) = (minus(min, point), minus(point, max));
    let outside = [
        below[0].max(above[0]).max(Vec4::ZERO),
        below[1].max(above[1]).max(Vec4::ZERO),
        below[2].max(above[2]).max(Vec4::ZERO),
    ];
    dot(&outside, &outside) * BOX_SLACK
}

/// Squared distances to the triangles of a pack, without branches; NaN for unused lanes.
#[inline]
pub(super) fn pack_distances(pack: &TrianglePack, point: &[Vec4; 3]) -> Vec4 {
    let c = minus(point, &pack.corner);
    let edge3 = minus(&pack.edge2, &pack.edge1);
    let from_second = minus(&c, &pack.edge1);

    let d1 = dot(&pack.edge1, &c);
    let d2 = dot(&pack.edge2, &c);
    let length1 = dot(&pack.edge1, &pack.edge1);
    let length2 = dot(&pack.edge2, &pack.edge2);

    // On which side of each edge the projection lies. The usual products of dot products would lose precision with
    // the square of a sliver's aspect ratio.
    let around_first = cross(&c, &pack.normal);
    let around_second = cross(&from_second, &pack.normal);
    let inside = dot(&pack.edge1, &around_first)
        .min(-dot(&pack.edge2, &around_first))
        .min(dot(&edge3, &around_second))
        .cmpge(Vec4::ZERO);
    let height = dot(&pack.normal, &c);

    let edges = edge_distance(&c, &pack.edge1, d1, length1)
        .min(edge_distance(&c, &pack.edge2, d2, length2))
        .min(edge_distance(
            &from_second,
            &edge3,
            dot(&edge3, &from_second),
            dot(&edge3, &edge3),
        ));
    Vec4::select(inside, height * height, edges)
}

/// Squared distances from points to edges. `along` is the dot product of `from_start` and the edge.
#[inline]
fn edge_distance(from_start: &[Vec4; 3], edge: &[Vec4; 3], along: Vec4, squared_length: Vec4) -> Vec4 {
    let t = (along / squared_length).max(Vec4::ZERO).min(Vec4::ONE);
    let offset = minus(from_start, &[edge[0] * t, edge[1] * t, edge[2] * t]);
    dot(&offset, &offset)
}

/// The point of a triangle closest to `point`, in double precision, by testing the Voronoi regions of corners, edges
/// and face in turn (C. Ericson: Real-Time Collision Detection, 2005, 5.1.5).
pub(super) fn closest_on_triangle(corners: [Vec3; 3], point: DVec3) -> DVec3 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let (ab, ac) = (b - a, c - a);
    let ap = point - a;
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = point - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let beyond_ab = d1 * d4 - d3 * d2;
    if beyond_ab <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let beyond_ac = d5 * d2 - d1 * d6;
    if beyond_ac <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let beyond_bc = d3 * d6 - d5 * d4;
    if beyond_bc <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let scale = (beyond_bc + beyond_ac + beyond_ab).recip();
    a + ab * (beyond_ac * scale) + ac * (beyond_ab * scale)
}

/// The distance of a point from a triangle, in metres.
pub(super) fn distance_of_point(corners: [Vec3; 3], point: Vec3) -> f32 {
    let point = point.as_dvec3();
    closest_on_triangle(corners, point).distance(point) as f32
}

/// True if a segment crosses a triangle or meets its edge.
pub(super) fn is_crossed(corners: [Vec3; 3], segment: Segment) -> bool {
    ExactQuery::new(segment).crossing(corners).is_some()
}

/// The distance of a segment from a triangle, in metres: 0 where they cross, or else at an end of the segment or an edge.
pub(super) fn distance_of_segment(corners: [Vec3; 3], segment: Segment) -> f32 {
    if is_crossed(corners, segment) {
        return 0.0;
    }
    let line = |start, end| TaperedCapsule::new(start, end, 0.0, 0.0);
    let axis = line(segment.start, segment.end);
    let [a, b, c] = corners;
    let of_edges = [(a, b), (b, c), (c, a)].map(|(start, end)| line(start, end).distance(&axis));
    let of_ends = [segment.start, segment.end].map(|end| distance_of_point(corners, end));
    of_edges.into_iter().chain(of_ends).fold(f32::INFINITY, f32::min)
}
