//! Brute force in double precision, written without a look at the crate's own tests of triangles.

use glam::{DMat3, DVec3, Vec3};
use grasp_synthesis::geometry::{Segment, mesh::TriangleMesh};

/// How sure brute force is that a segment crosses a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Verdict {
    Misses,
    /// Within rounding of an edge, of an endpoint, or of being parallel.
    TooCloseToCall,
    /// At this share of the segment.
    Crosses(f64),
}

/// Share of a triangle below which a barycentric coordinate is not told from zero.
const EDGE: f64 = 1e-9;
/// Share of a segment below which a distance along it is not told from zero.
const END: f64 = 1e-9;

/// Solves start + t·direction = a + u·(b - a) + v·(c - a) by Cramer's rule.
pub(crate) fn crosses_triangle(corners: [Vec3; 3], segment: Segment) -> Verdict {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let start = segment.start.as_dvec3();
    let direction = segment.end.as_dvec3() - start;
    let matrix = DMat3::from_cols(-direction, b - a, c - a);
    let scale = direction.length() * (b - a).length() * (c - a).length();
    let determinant = matrix.determinant();
    if scale == 0.0 {
        return Verdict::Misses;
    }
    let right = start - a;
    let with = |column: usize| {
        let mut columns = [matrix.col(0), matrix.col(1), matrix.col(2)];
        columns[column] = right;
        DMat3::from_cols(columns[0], columns[1], columns[2]).determinant()
    };
    if determinant.abs() <= 1e-13 * scale {
        // Parallel: a crossing only if it lies in the plane, which nobody can tell.
        let off_plane = with(0).abs() / ((b - a).cross(c - a).length());
        return if off_plane > 1e-9 * (right.length() + direction.length()) {
            Verdict::Misses
        } else {
            Verdict::TooCloseToCall
        };
    }
    let (t, u, v) = (
        with(0) / determinant,
        with(1) / determinant,
        with(2) / determinant,
    );
    let across = u.min(v).min(1.0 - u - v);
    let along = t.min(1.0 - t);
    // Near-parallel segments blow up the rounding.
    let blow_up = 1e-13 * scale / determinant.abs() * (1.0 + right.length() / direction.length());
    if across < -EDGE - blow_up || along < -END - blow_up {
        Verdict::Misses
    } else if across > EDGE + blow_up && along > END + blow_up {
        Verdict::Crosses(t)
    } else {
        Verdict::TooCloseToCall
    }
}

/// The verdicts over a whole mesh.
pub(crate) struct MeshVerdict {
    /// The nearest certain crossing: triangle and share of the segment.
    pub(crate) nearest: Option<(usize, f64)>,
    /// Is any triangle too close to call?
    pub(crate) doubtful: bool,
}

pub(crate) fn crosses_mesh(mesh: &TriangleMesh, segment: Segment) -> MeshVerdict {
    let mut verdict = MeshVerdict {
        nearest: None,
        doubtful: false,
    };
    for triangle in 0..mesh.triangles().len() {
        match crosses_triangle(mesh.corners(triangle), segment) {
            Verdict::Misses => {}
            Verdict::TooCloseToCall => verdict.doubtful = true,
            Verdict::Crosses(t) => {
                if verdict.nearest.is_none_or(|(_, known)| t < known) {
                    verdict.nearest = Some((triangle, t));
                }
            }
        }
    }
    verdict
}

/// Distance from a point to a triangle: the plane if the projection lies inside, else the nearest edge.
pub(crate) fn distance_to_triangle(corners: [Vec3; 3], point: Vec3) -> f64 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let point = point.as_dvec3();
    let normal = (b - a).cross(c - a).normalize();
    let on_inner_side = |from: DVec3, to: DVec3| normal.dot((to - from).cross(point - from)) >= 0.0;
    if on_inner_side(a, b) && on_inner_side(b, c) && on_inner_side(c, a) {
        return normal.dot(point - a).abs();
    }
    let to_edge = |from: DVec3, to: DVec3| {
        let t = ((point - from).dot(to - from) / (to - from).length_squared()).clamp(0.0, 1.0);
        point.distance(from + t * (to - from))
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

pub(crate) fn distance_to_mesh(mesh: &TriangleMesh, point: Vec3) -> f64 {
    (0..mesh.triangles().len())
        .map(|triangle| distance_to_triangle(mesh.corners(triangle), point))
        .fold(f64::INFINITY, f64::min)
}

/// The generalised winding number: the sum of the triangles' signed solid angles by L'Huilier's theorem on the
/// spherical triangle, over the full sphere.
pub(crate) fn winding_number(mesh: &TriangleMesh, point: Vec3) -> f64 {
    let solid_angle = |corners: [Vec3; 3]| {
        let [a, b, c] = corners.map(|corner| (corner.as_dvec3() - point.as_dvec3()).normalize());
        // Arcs by their chords, which is exact for short ones too.
        let arc = |p: DVec3, q: DVec3| 2.0 * (0.5 * p.distance(q)).clamp(0.0, 1.0).asin();
        let sides = [arc(b, c), arc(c, a), arc(a, b)];
        let half = 0.5 * sides.iter().sum::<f64>();
        let product = (0.5 * half).tan()
            * sides
                .iter()
                .map(|side| (0.5 * (half - side)).max(0.0).tan())
                .product::<f64>();
        let excess = 4.0 * product.max(0.0).sqrt().atan();
        excess.copysign(a.dot(b.cross(c)))
    };
    (0..mesh.triangles().len())
        .map(|triangle| solid_angle(mesh.corners(triangle)))
        .sum::<f64>()
        / (4.0 * std::f64::consts::PI)
}
