//! Crossings of segments with triangles.
//!
//! Every query runs in two stages. The first tests four triangles at once in `f32` (T. Möller, B. Trumbore: Fast,
//! Minimum Storage Ray-Triangle Intersection, 1997) with a bound on its rounding error. Cases within that bound (the
//! segment passes close to an edge, or an endpoint lies close to the surface) go to the second stage in `f64`. Thus no
//! crossing is lost near the ends of a segment or between two triangles that share an edge.

use std::cell::Cell;

use glam::{BVec4A, DVec3, Vec3, Vec4};

use super::{
    Segment,
    mesh::TriangleMesh,
    wide_bvh::{Node, TrianglePack, WideBvh, lanes},
};

/// Bound of the `f32` stage's rounding error, relative to the product of the lengths: about 20 operations of half an epsilon.
const ROUNDING: f32 = 16.0 * f32::EPSILON;

/// Relative slack of the interval in which a segment is inside a box: three roundings each of two plane distances.
const SLAB_SLACK: f32 = 1.0 + 8.0 * f32::EPSILON;

/// Replaces zero components of the direction, in metres, to keep their inverse finite.
const TINY_COMPONENT: f32 = 1e-18;

/// A segment prepared for the inner loops: start + t·direction for t from 0 to 1.
pub(super) struct Query {
    start: [Vec4; 3],
    direction: [Vec4; 3],
    inverse: [Vec4; 3],
    /// By axis: 0 if the segment runs toward larger coordinates, 1 if toward smaller ones.
    near: [usize; 3],
    length: f32,
    segment: Segment,
}

impl Query {
    /// Prepares a segment.
    #[inline]
    pub(super) fn new(segment: Segment) -> Self {
        let direction = segment.end - segment.start;
        let safe = direction
            .abs()
            .max(Vec3::splat(TINY_COMPONENT))
            .copysign(direction);
        let inverse = safe.recip();
        Self {
            start: splat(segment.start),
            direction: splat(direction),
            inverse: splat(inverse),
            near: [
                usize::from(inverse.x < 0.0),
                usize::from(inverse.y < 0.0),
                usize::from(inverse.z < 0.0),
            ],
            length: direction.length(),
            segment,
        }
    }

    /// Bit mask of the children whose boxes the segment enters before `t_max`.
    #[inline]
    fn entered(&self, node: &Node, t_max: Vec4) -> u32 {
        let plane = |side: usize, axis: usize| {
            (node.bounds[(self.near[axis] ^ side) & 1][axis] - self.start[axis]) * self.inverse[axis]
        };
        let enter = plane(0, 0).max(plane(0, 1)).max(plane(0, 2).max(Vec4::ZERO));
        let leave = plane(1, 0).min(plane(1, 1)).min(plane(1, 2).min(t_max));
        enter.cmple(leave * SLAB_SLACK).bitmask()
    }

    /// Masks of the triangles of a pack that the segment certainly crosses, and of those that it possibly crosses.
    #[inline]
    fn filter(&self, pack: &TrianglePack) -> (BVec4A, BVec4A) {
        let d = &self.direction;
        let c: [Vec4; 3] = minus(&pack.corner, &self.start);
        let r = cross(&c, d);
        let facing = dot(&pack.normal, d);
        // Flip signs so that the segment runs along the normal.
        let sign = Vec4::ONE.copysign(facing);
        let determinant = pack.doubled_area * (facing * sign);
        let u = dot(&pack.edge2, &r) * sign;
        let v = -dot(&pack.edge1, &r) * sign;
        let w = determinant - u - v;
        let along = dot(&pack.normal, &c) * sign;
        let left = facing * sign - along;
        let distance = c[0].abs() + c[1].abs() + c[2].abs();
        let across_error = (pack.reach * (ROUNDING * self.length)) * (distance + pack.reach);
        let along_error = (distance + Vec4::splat(self.length)) * ROUNDING;
        let across = u.min(v).min(w);
        let within = along.min(left);
        let certain = across.cmpgt(across_error) & within.cmpgt(along_error);
        let possible = across.cmpge(-across_error) & within.cmpge(-along_error);
        (certain, possible)
    }
}

/// A segment in double precision.
pub(super) struct ExactQuery {
    start: DVec3,
    direction: DVec3,
}

/// Where a segment crosses a triangle, in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    /// Parameter of the crossing along the segment, 0 to 1.
    pub(super) t: f64,
    /// True if the segment leaves the volume: if it runs along the normal.
    pub(super) leaves: bool,
}

/// The outcome of a test in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ExactCrossing {
    /// It misses the triangle.
    Miss,
    /// It passes within rounding of an edge, or lies within rounding of the triangle's plane.
    Graze(Option<Crossing>),
    /// It crosses the triangle's interior.
    Hit(Crossing),
}

impl ExactQuery {
    /// Prepares a segment.
    pub(super) fn new(segment: Segment) -> Self {
        Self {
            start: segment.start.as_dvec3(),
            direction: segment.end.as_dvec3() - segment.start.as_dvec3(),
        }
    }

    /// Tests a triangle by the signed volumes that the segment's line spans with its three edges. Two triangles that
    /// share an edge compute the same volume with opposite sign, so that nothing slips between them (S. Woop, C.
    /// Benthin, I. Wald: Watertight Ray/Triangle Intersection, 2013). A segment in the triangle's plane does not
    /// cross it.
    pub(super) fn test(&self, corners: [Vec3; 3]) -> ExactCrossing {
        /// Share of the summed volumes below which one counts as zero: thousands of roundings.
        const GRAZE: f64 = 1e-12;
        /// Rounding error of a volume, relative to the product of its lengths: some ten roundings.
        const NOISE: f64 = 4e-15;
        let [a, b, c] = corners.map(|corner| corner.as_dvec3() - self.start);
        let volumes = [b.cross(c), c.cross(a), a.cross(b)].map(|product| self.direction.dot(product));
        let smallest = volumes[0].min(volumes[1]).min(volumes[2]);
        let largest = volumes[0].max(volumes[1]).max(volumes[2]);
        let reach = a.length_squared().max(b.length_squared()).max(c.length_squared());
        let noise = NOISE * self.direction.length() * reach;
        let slack = GRAZE * (volumes[0].abs() + volumes[1].abs() + volumes[2].abs()) + noise;
        if smallest < -slack && largest > slack {
            return ExactCrossing::Miss;
        }
        let normal = (b - a).cross(c - a);
        let facing = self.direction.dot(normal);
        if facing.abs() <= noise {
            return ExactCrossing::Graze(None);
        }
        let t = a.dot(normal) / facing;
        let passes_inside = smallest >= 0.0 || largest <= 0.0;
        let crossing = (passes_inside && (0.0..=1.0).contains(&t)).then_some(Crossing {
            t,
            leaves: facing > 0.0,
        });
        let clear = smallest > slack || largest < -slack;
        match crossing {
            Some(crossing) if clear => ExactCrossing::Hit(crossing),
            None if clear => ExactCrossing::Miss,
            grazing => ExactCrossing::Graze(grazing),
        }
    }

    /// The crossing, in the interior or on an edge.
    pub(super) fn crossing(&self, corners: [Vec3; 3]) -> Option<Crossing> {
        match self.test(corners) {
            ExactCrossing::Miss => None,
            ExactCrossing::Graze(crossing) => crossing,
            ExactCrossing::Hit(crossing) => Some(crossing),
        }
    }
}

/// True if the segment crosses any triangle, endpoints included. Not inlined: the many segments that miss the mesh's
/// box must not pay for the stack.
#[inline(never)]
pub(super) fn crosses_any(bvh: &WideBvh, mesh: &TriangleMesh, segment: Segment) -> bool {
    let query = Query::new(segment);
    let mut crosses = false;
    bvh.visit(
        |node| query.entered(node, Vec4::ONE),
        |pack| {
            let (certain, possible) = query.filter(pack);
            crosses = certain.any() || (possible.any() && any_crossing(&query, pack, possible, mesh));
            !crosses
        },
    );
    crosses
}

/// True if the segment crosses one of the possible triangles of a pack, in double precision.
#[cold]
fn any_crossing(query: &Query, pack: &TrianglePack, possible: BVec4A, mesh: &TriangleMesh) -> bool {
    let exact = ExactQuery::new(query.segment);
    lanes(possible.bitmask()).any(|lane| {
        let corners = mesh.corners(pack.triangle(lane) as usize);
        exact.crossing(corners).is_some()
    })
}

/// The triangle that the segment crosses first, and the crossing. Of several at the same point, the lowest index wins.
pub(super) fn first(bvh: &WideBvh, mesh: &TriangleMesh, segment: Segment) -> Option<(u32, Crossing)> {
    let query = Query::new(segment);
    let exact = ExactQuery::new(segment);
    let mut best: Option<(u32, Crossing)> = None;
    let t_max = Cell::new(Vec4::ONE);
    bvh.visit(
        |node| query.entered(node, t_max.get()),
        |pack| {
            for lane in lanes(query.filter(pack).1.bitmask()) {
                let triangle = pack.triangle(lane);
                let Some(crossing) = exact.crossing(mesh.corners(triangle as usize)) else {
                    continue;
                };
                let nearer = best.is_none_or(|(other, known)| {
                    crossing.t < known.t || (crossing.t == known.t && triangle < other)
                });
                if nearer {
                    best = Some((triangle, crossing));
                    t_max.set(Vec4::splat(crossing.t as f32 * SLAB_SLACK));
                }
            }
            true
        },
    );
    best
}

/// Number of packs of triangles whose boxes a segment enters.
pub(super) fn packs_along(bvh: &WideBvh, segment: Segment) -> usize {
    let query = Query::new(segment);
    let mut packs = 0;
    bvh.visit(
        |node| query.entered(node, Vec4::ONE),
        |_| {
            packs += 1;
            true
        },
    );
    packs
}

/// Passes every candidate triangle and its exact outcome to `visit`, in no particular order, until it returns false.
pub(super) fn visit_all(
    bvh: &WideBvh,
    mesh: &TriangleMesh,
    segment: Segment,
    mut visit: impl FnMut(u32, ExactCrossing) -> bool,
) {
    let query = Query::new(segment);
    let exact = ExactQuery::new(segment);
    bvh.visit(
        |node| query.entered(node, Vec4::ONE),
        |pack| {
            lanes(query.filter(pack).1.bitmask()).all(|lane| {
                let triangle = pack.triangle(lane);
                visit(triangle, exact.test(mesh.corners(triangle as usize)))
            })
        },
    );
}

/// A vector in all lanes.
#[inline]
pub(super) fn splat(v: Vec3) -> [Vec4; 3] {
    [Vec4::splat(v.x), Vec4::splat(v.y), Vec4::splat(v.z)]
}

/// Four dot products.
#[inline]
pub(super) fn dot(a: &[Vec4; 3], b: &[Vec4; 3]) -> Vec4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Four differences. Written out by axis because `array::from_fn` with a closure would not be inlined.
#[inline]
pub(super) fn minus(a: &[Vec4; 3], b: &[Vec4; 3]) -> [Vec4; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Four points `from` + `direction` · t.
#[inline]
pub(super) fn point_along(from: &[Vec4; 3], direction: &[Vec4; 3], t: Vec4) -> [Vec4; 3] {
    [
        from[0] + direction[0] * t,
        from[1] + direction[1] * t,
        from[2] + direction[2] * t,
    ]
}

/// Four cross products.
#[inline]
pub(super) fn cross(a: &[Vec4; 3], b: &[Vec4; 3]) -> [Vec4; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
