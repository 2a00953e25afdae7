//! Whether a mesh's volume contains a point: the generalised winding number, at the price of a ray.
//!
//! The winding number of a point (A. Jacobson, L. Kavan, O. Sorkine-Hornung: Robust Inside-Outside Segmentation using
//! Generalized Winding Numbers, 2013) is the number of times the surface encloses it, a fraction where the surface has
//! holes. Where it is closed, a ray that leaves the surface as often as it enters plus w times has winding number w;
//! overlapping closed parts add up and cavities cancel. Where it has holes, cones from one apex over their rims close
//! it: the ray then counts mesh and cones, and the solid angles of the cones are subtracted (the closing of
//! section 4.1 there). Only the rims cost extra, and the result is that of the sum over all triangles.

use glam::{DVec3, Vec3};

use super::{
    Segment,
    aabb::Aabb,
    crossing::{self, ExactCrossing, ExactQuery},
    mesh::TriangleMesh,
    topology,
    wide_bvh::WideBvh,
};

/// Winding numbers of a larger magnitude are inside: halfway between enclosed once and not at all. A mesh that is
/// inside out as a whole still encloses its volume.
const INSIDE: f64 = 0.5;

/// Fixed directions of the rays, by falling preference: unit vectors, none along or near an axis, a diagonal or each
/// other, since modelled surfaces like those. A ray that grazes an edge is void and the next is tried.
const DIRECTIONS: [Vec3; 4] = [
    Vec3::new(0.858_314_5, 0.393_482_4, 0.329_470_7),
    Vec3::new(-0.314_159_3, 0.876_129_6, -0.365_632_5),
    Vec3::new(0.271_828_2, -0.445_761_3, 0.852_895_3),
    Vec3::new(-0.607_143_9, -0.231_764_5, -0.760_050_3),
];

/// A triangle of a cone over the rim of a hole.
#[derive(Clone, Copy, Debug)]
struct Cap {
    corners: [Vec3; 3],
    /// How often it counts.
    count: f64,
}

/// What containment needs beside the hierarchy.
#[derive(Clone, Debug)]
pub(super) struct Containment {
    caps: Vec<Cap>,
    /// Longer than any way out of the box of mesh and cones, in metres.
    reach: f32,
}

impl Containment {
    /// Finds the rims of a mesh; O(n).
    pub(super) fn of(mesh: &TriangleMesh, aabb: &Aabb) -> Self {
        let boundary = topology::boundary_chain(mesh);
        // Inside the box, so that the cones are too.
        let apex = aabb.centre();
        let caps = boundary
            .into_iter()
            .map(|([from, to], count)| Cap {
                // Against the direction of the rim, as a neighbouring triangle would.
                corners: [to, from, apex],
                count: f64::from(count),
            })
            .collect();
        Self {
            caps,
            reach: 2.0 * aabb.diagonal(),
        }
    }

    /// True if the volume contains the point, which must lie in the mesh's box.
    pub(super) fn contains(&self, bvh: &WideBvh, mesh: &TriangleMesh, point: Vec3) -> bool {
        let winding = DIRECTIONS
            .iter()
            .find_map(|&direction| self.winding_along(bvh, mesh, point, direction))
            .unwrap_or_else(|| winding_number(mesh, point));
        winding.abs() > INSIDE
    }

    /// The winding number, counted along a ray; nothing if the ray grazes an edge.
    fn winding_along(&self, bvh: &WideBvh, mesh: &TriangleMesh, point: Vec3, direction: Vec3) -> Option<f64> {
        let ray = Segment::new(point, point + direction * self.reach);
        let mut crossings = Some(0.0);
        crossing::visit_all(bvh, mesh, ray, |outcome| {
            crossings = crossings.zip(signed(outcome)).map(|(sum, sign)| sum + sign);
            crossings.is_some()
        });
        let mut winding = crossings?;
        if !self.caps.is_empty() {
            let exact = ExactQuery::new(ray);
            for cap in &self.caps {
                let through = signed(exact.test(cap.corners))?;
                winding += cap.count * (through - solid_angle_share(cap.corners, point));
            }
        }
        Some(winding)
    }
}

/// +1 for leaving, -1 for entering, nothing for a graze.
fn signed(outcome: ExactCrossing) -> Option<f64> {
    match outcome {
        ExactCrossing::Miss => Some(0.0),
        ExactCrossing::Hit(crossing) => Some(if crossing.leaves { 1.0 } else { -1.0 }),
        ExactCrossing::Graze(_) => None,
    }
}

/// The generalised winding number by its definition: the solid angles of all triangles; O(n).
fn winding_number(mesh: &TriangleMesh, point: Vec3) -> f64 {
    (0..mesh.triangles().len())
        .map(|triangle| solid_angle_share(mesh.corners(triangle), point))
        .sum()
}

/// The signed solid angle of a triangle seen from a point as a share of the full sphere (A. van Oosterom, J. Strackee:
/// The Solid Angle of a Plane Triangle, 1983); positive if the point sees its back.
fn solid_angle_share(corners: [Vec3; 3], point: Vec3) -> f64 {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3() - point.as_dvec3());
    let (la, lb, lc) = (DVec3::length(a), DVec3::length(b), DVec3::length(c));
    let numerator = a.dot(b.cross(c));
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    numerator.atan2(denominator) / std::f64::consts::TAU
}
