//! Where on an object opposed digits may press: points of the surface and what lies opposite of them.

use glam::Vec3;

use crate::{
    base::random::AttemptStream,
    geometry::{Segment, mesh_bvh::MeshBvh},
    physical::solids::PreparedHand,
};

/// Points that are drawn on the surface. More cover small parts of large objects better and cost registration time, about
/// a microsecond each.
const SAMPLES: u64 = 2048;

/// The seed of the points: any will do, and every object has the same points forever.
const SEED: u64 = 0x5041_4952;

/// How far a ray starts below the surface, in metres, so that it does not meet the triangle that it starts on.
const START_DEPTH: f32 = 1e-5;

/// The thickest that a hand gets round, in metres.
const THICKEST: f32 = 0.15;

/// Largest slant of the ray from the inward normal, as a tangent: about that of a friction cone.
const SLANT: f32 = 0.4;

/// Least cosine between the ray and the normals at both ends: 45°. Less, and pads slip off.
const LEAST_COS: f32 = 0.7;

/// What a fingertip needs between a point that it presses and the giver's hand, in metres: half its thickness.
const FINGER_ROOM: f32 = 0.006;

/// The same for the palm.
const PALM_ROOM: f32 = 0.012;

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// In metres.
    pub position: Vec3,
    /// Outward unit normal.
    pub normal: Vec3,
}

impl SurfacePoint {
    /// True if a palm has room there beside a giver's hand.
    pub fn is_free_of(&self, giver: &PreparedHand) -> bool {
        !giver.certainly_within(self.position, 0.0, PALM_ROOM)
    }
}

/// Two points of the surface that opposed digits may press together, straight through the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePair {
    /// The one end, in metres.
    pub start: Vec3,
    /// The other end.
    pub end: Vec3,
    /// Distance between them.
    pub thickness: f32,
}

impl SurfacePair {
    /// True if fingers have room at both ends beside a giver's hand.
    pub fn is_free_of(&self, giver: &PreparedHand) -> bool {
        [self.start, self.end]
            .iter()
            .all(|&end| !giver.certainly_within(end, 0.0, FINGER_ROOM))
    }
}

/// What GUIDED search knows of an object's surface. In the object's frame.
#[derive(Clone, Debug, Default)]
pub struct SurfacePairs {
    pairs: Vec<SurfacePair>,
    /// Points that may be touched, uniform over the surface.
    points: Vec<SurfacePoint>,
}

impl SurfacePairs {
    /// Draws points on a surface; on triangles that `is_forbidden` says, none.
    pub fn of(surface: &MeshBvh, is_forbidden: impl Fn(u32) -> bool) -> Self {
        let mesh = surface.mesh();
        let mut sum = 0.0;
        let heights: Vec<f64> = (0..mesh.triangles().len())
            .map(|triangle| {
                if !is_forbidden(triangle as u32) {
                    let [a, b, c] = mesh.corners(triangle).map(Vec3::as_dvec3);
                    sum += (b - a).cross(c - a).length();
                }
                sum
            })
            .collect();
        let mut found = Self::default();
        if sum <= 0.0 {
            return found;
        }
        for sample in 0..SAMPLES {
            let mut stream = AttemptStream::new(SEED, sample);
            // Stratified: every sample has its own share of the area.
            let height = (sample as f64 + f64::from(stream.unit())) / SAMPLES as f64 * sum;
            let triangle = heights
                .partition_point(|&end| end <= height)
                .min(heights.len() - 1);
            let [a, b, c] = mesh.corners(triangle);
            let (mut u, mut v) = (stream.unit(), stream.unit());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let point = SurfacePoint {
                position: a + (b - a) * u + (c - a) * v,
                normal: mesh.normal(triangle),
            };
            found.points.push(point);
            let aside = point.normal.any_orthogonal_vector() * stream.between(-SLANT, SLANT)
                + point.normal.cross(point.normal.any_orthogonal_vector()) * stream.between(-SLANT, SLANT);
            let inward = (aside - point.normal).normalize_or(-point.normal);
            let start = point.position + inward * START_DEPTH;
            let ray = Segment::new(start, start + inward * THICKEST);
            let Some(exit) = surface.first_hit(ray) else {
                continue;
            };
            let opposite = mesh.normal(exit.triangle as usize);
            if is_forbidden(exit.triangle)
                || opposite.dot(inward) < LEAST_COS
                || -point.normal.dot(inward) < LEAST_COS
            {
                continue;
            }
            found.pairs.push(SurfacePair {
                start: point.position,
                end: exit.position,
                thickness: exit.distance + START_DEPTH,
            });
        }
        found
    }

    /// The pairs and points that a giver's hand leaves free: those that a finger, and a palm, has room at. Worth its time
    /// where much is drawn from them.
    #[must_use]
    pub fn free_of(&self, giver: &PreparedHand) -> Self {
        Self {
            pairs: self
                .pairs
                .iter()
                .filter(|pair| pair.is_free_of(giver))
                .copied()
                .collect(),
            points: self
                .points
                .iter()
                .filter(|point| point.is_free_of(giver))
                .copied()
                .collect(),
        }
    }

    /// Bytes that pairs and points take.
    pub fn bytes(&self) -> usize {
        size_of_val(self.pairs.as_slice()) + size_of_val(self.points.as_slice())
    }

    /// A pair, turned either way; none if the object has none.
    pub fn pair(&self, stream: &mut AttemptStream) -> Option<SurfacePair> {
        if self.pairs.is_empty() {
            return None;
        }
        let pair = self.pairs[stream.below(self.pairs.len())];
        Some(if stream.unit() < 0.5 {
            pair
        } else {
            SurfacePair {
                start: pair.end,
                end: pair.start,
                ..pair
            }
        })
    }

    /// A point of the surface; none if all of it is forbidden.
    pub fn point(&self, stream: &mut AttemptStream) -> Option<SurfacePoint> {
        (!self.points.is_empty()).then(|| self.points[stream.below(self.points.len())])
    }
}
