//! Tests whether a mesh's volume contains a point, by the generalised winding number at the cost of one ray.
//!
//! The winding number of a point (A. Jacobson, L. Kavan, O. Sorkine-Hornung: Robust Inside-Outside Segmentation using
//! Generalized Winding Numbers, 2013) is the number of times the surface encloses it, a fraction where the surface
//! has
//! holes. For a closed surface it is the number of times that a ray from the point leaves the surface minus the
//! number
//! of times that it enters: overlapping parts add up and cavities cancel. Holes are closed by cones from one apex
//! over
//! their rims: the ray counts mesh and cones, and the solid angles of the cones are subtracted (section 4.1 there).
//! Only the rims cost extra, and the result equals the sum of solid angles over all triangles. Sheets enclose nothing and
//! are left out.

use glam::{DVec3, Vec3};

use super::{
    Segment,
    aabb::Aabb,
    crossing::{self, ExactCrossing, ExactQuery},
    mesh::TriangleMesh,
    topology,
    wide_bvh::WideBvh,
};
use crate::base::stop::{Stop, Stopped};

/// Points whose winding number exceeds this in magnitude are inside: halfway between not enclosed and enclosed once.
/// The magnitude makes a mesh that is inside out as a whole enclose its volume too.
const INSIDE: f64 = 0.5;

/// Directions of the rays, in order of preference: unit vectors away from axes, diagonals and each other, along which
/// modelled surfaces tend to run. If a ray grazes an edge, the next direction is tried.
const DIRECTIONS: [Vec3; 4] = [
    Vec3::new(0.858_314_5, 0.393_482_4, 0.329_470_7),
    Vec3::new(-0.314_159_3, 0.876_129_6, -0.365_632_5),
    Vec3::new(0.271_828_2, -0.445_761_3, 0.852_895_3),
    Vec3::new(-0.607_143_9, -0.231_764_5, -0.760_050_3),
];

/// A triangle of the cone that closes a hole.
#[derive(Clone, Copy, Debug)]
struct Cap {
    corners: [Vec3; 3],
    /// Its multiplicity, signed.
    count: f64,
}

/// What the containment test needs in addition to the hierarchy.
#[derive(Clone, Debug)]
pub(super) struct Containment {
    caps: Vec<Cap>,
    /// One flag per triangle: true if it belongs to a sheet. Empty without sheets.
    is_sheet: Vec<bool>,
    /// Length of the rays, in metres: enough to leave the box of mesh and cones from any point in it.
    ray_length: f32,
}

impl Containment {
    /// Finds the rims of a mesh's holes and closes them; O(n).
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn of(mesh: &TriangleMesh, aabb: &Aabb, stop: Stop<'_>) -> Result<Self, Stopped> {
        let mut boundary = topology::boundary_chain(mesh);
        let is_sheet = if boundary.is_empty() {
            Vec::new()
        } else {
            topology::sheets(mesh, stop, |point| winding_number(mesh, point, |_| true))?
        };
        if !is_sheet.is_empty() {
            let volumes = mesh.submesh(|triangle| !is_sheet[triangle]);
            boundary = volumes.map_or_else(Vec::new, |volumes| topology::boundary_chain(&volumes));
        }
        // An apex inside the box keeps the cones inside.
        let apex = aabb.centre();
        let caps = boundary
            .into_iter()
            .map(|([from, to], count)| Cap {
                // Traverses the rim backward, as a neighbouring triangle would.
                corners: [to, from, apex],
                count: f64::from(count),
            })
            .collect();
        Ok(Self {
            caps,
            is_sheet,
            ray_length: 2.0 * aabb.diagonal(),
        })
    }

    /// True if the volume contains the point, which must lie inside the mesh's box.
    pub(super) fn contains(&self, bvh: &WideBvh, mesh: &TriangleMesh, point: Vec3) -> bool {
        let winding = DIRECTIONS
            .iter()
            .find_map(|&direction| self.winding_along(bvh, mesh, point, direction))
            .unwrap_or_else(|| winding_number(mesh, point, |triangle| !self.is_sheet(triangle)));
        winding.abs() > INSIDE
    }

    /// The winding number, counted along a ray; `None` if the ray grazes an edge.
    fn winding_along(&self, bvh: &WideBvh, mesh: &TriangleMesh, point: Vec3, direction: Vec3) -> Option<f64> {
        let ray = Segment::new(point, point + direction * self.ray_length);
        let mut crossings = Some(0.0);
        crossing::visit_all(bvh, mesh, ray, |triangle, outcome| {
            if self.is_sheet(triangle as usize) {
                return true;
            }
            crossings = crossings.zip(signed(outcome)).map(|(sum, sign)| sum + sign);
            crossings.is_some()
        });
        let mut winding = crossings?;
        if !self.caps.is_empty() {
            let exact = ExactQuery::new(ray);
            for cap in &self.caps {
                let crossed = signed(exact.test(cap.corners))?;
                winding += cap.count * (crossed - solid_angle_share(cap.corners, point));
            }
        }
        Some(winding)
    }

    /// Number of edges of the holes' rims, in proportion to which each test takes time.
    pub(super) fn rim_edges(&self) -> usize {
        self.caps.len()
    }

    /// Memory use in bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.caps.as_slice()) + size_of_val(self.is_sheet.as_slice())
    }

    /// True if the triangle belongs to a sheet.
    pub(super) fn is_sheet(&self, triangle: usize) -> bool {
        self.is_sheet.get(triangle).is_some_and(|&is_sheet| is_sheet)
    }
}

/// +1 for leaving the volume, -1 for entering, 0 for a miss, `None` for a graze.
fn signed(outcome: ExactCrossing) -> Option<f64> {
    match outcome {
        ExactCrossing::Miss => Some(0.0),
        ExactCrossing::Hit(crossing) => Some(if crossing.leaves { 1.0 } else { -1.0 }),
        ExactCrossing::Graze(_) => None,
    }
}

/// The generalised winding number by its definition, from the solid angles of the triangles that `counts` accepts; O(n).
fn winding_number(mesh: &TriangleMesh, point: Vec3, counts: impl Fn(usize) -> bool) -> f64 {
    (0..mesh.triangles().len())
        .filter(|&triangle| counts(triangle))
        .map(|triangle| solid_angle_share(mesh.corners(triangle), point))
        .sum()
}

/// The signed solid angle of a triangle seen from a point, as a share of the full sphere; positive if the point sees
/// the back of the triangle (A. van Oosterom, J. Strackee: The Solid Angle of a Plane Triangle, 1983).
fn solid_angle_share(corners: [Vec3; 3], point: Vec3) -> f64 {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3() - point.as_dvec3());
    let (la, lb, lc) = (DVec3::length(a), DVec3::length(b), DVec3::length(c));
    let numerator = a.dot(b.cross(c));
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    numerator.atan2(denominator) / std::f64::consts::TAU
}
