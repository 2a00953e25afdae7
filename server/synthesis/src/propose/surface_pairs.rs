//! Points where opposed digits or the palm may press: sampled on the surface, with the points opposite them. Also outer bounds on
//! the places where an object may be held at all.

use glam::Vec3;

use crate::{
    base::{
        random::AttemptStream,
        stop::{Stop, Stopped},
    },
    geometry::{
        Segment,
        boxes::OrientedBox,
        opposed::{OPPOSED_ACCURACY, OpposedDistance, opposed_distance},
        surface_samples::{SurfaceSampler, ray_stride},
        topology::Topology,
    },
    model::object::GraspObject,
    physical::barriers::Barriers,
};

/// Points sampled on the surface.
const SAMPLES: u64 = 2048;

/// Seed of the samples: arbitrary, but fixed so that an object always has the same points.
const SEED: u64 = 0x5041_4952;

/// Depth below the surface at which a ray starts, in metres, so that it does not hit its own triangle.
const START_DEPTH: f32 = 1e-5;

/// Largest thickness that a hand can grasp, in metres.
const MAX_THICKNESS: f32 = 0.15;

/// Largest slant of the ray from the inward normal, as a tangent per axis: about that of a friction cone.
const MAX_SLANT: f32 = 0.4;

/// Minimum cosine between the ray and the normals at both ends: 45°. Pads would slip beyond it.
const MIN_COS: f32 = 0.7;

/// Minimum distance in metres between a point pressed by a finger and another hand: half a finger's thickness.
const FINGER_CLEARANCE: f32 = 0.006;

/// Minimum distance in metres between a point touched by the palm and another hand.
const PALM_CLEARANCE: f32 = 0.012;

/// Minimum distance in metres between either point and an obstacle.
const OBSTACLE_CLEARANCE: f32 = 0.003;

/// Opposed places closer than this, in metres, are within any hand's reach and not compared further: most of an adult's span.
const CLOSE: f32 = 0.12;

/// Opposed places farther apart than this, in metres, are beyond any hand.
const FAR: f32 = 0.5;

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position in metres.
    pub position: Vec3,
    /// Outward unit normal.
    pub normal: Vec3,
    /// Wish for hands there, from 0 to 1.
    pub wish: f32,
}

impl SurfacePoint {
    /// True unless the point is certainly too close to a barrier for a palm.
    pub fn is_free_of(&self, barriers: Barriers<'_>) -> bool {
        !barriers.certainly_cover(self.position, PALM_CLEARANCE, OBSTACLE_CLEARANCE)
    }
}

/// Two points of the surface on opposite sides of the object, which opposed digits may press.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePair {
    /// One end, in metres.
    pub start: Vec3,
    /// The other end, in metres.
    pub end: Vec3,
    /// Distance between the ends, in metres.
    pub thickness: f32,
    /// Wish for hands there, from 0 to 1.
    pub wish: f32,
}

impl SurfacePair {
    /// True for the two sides of a sheet, which has no thickness.
    pub fn is_of_sheet(&self) -> bool {
        self.thickness <= START_DEPTH
    }

    /// The point midway between the ends, in metres.
    pub fn middle(&self) -> Vec3 {
        (self.start + self.end) * 0.5
    }

    /// True unless an end is certainly too close to a barrier for a finger.
    pub fn is_free_of(&self, barriers: Barriers<'_>) -> bool {
        [self.start, self.end]
            .iter()
            .all(|&end| !barriers.certainly_cover(end, FINGER_CLEARANCE, OBSTACLE_CLEARANCE))
    }
}

/// The sampled points and pairs of an object's surface, in the object's frame.
#[derive(Clone, Debug, Default)]
pub struct SurfacePairs {
    /// The pairs, in the order of the surface's triangles.
    pub pairs: Vec<SurfacePair>,
    /// Points that may be touched, uniformly distributed over the surface.
    pub points: Vec<SurfacePoint>,
}

impl SurfacePairs {
    /// Samples the surface of an object that may be touched.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of(object: &GraspObject, stop: Stop<'_>) -> Result<Self, Stopped> {
        let surface = &object.surface;
        let mesh = surface.mesh();
        let sampler = SurfaceSampler::new(mesh, |triangle| !object.is_forbidden(triangle));
        let mut sampled = Self::default();
        let stride = ray_stride(surface, &sampler, SAMPLES, SEED, MAX_THICKNESS);
        for sample in (0..SAMPLES).step_by(stride) {
            stop.check()?;
            let mut stream = AttemptStream::new(SEED, sample);
            let Some((triangle, position)) = sampler.sample(sample, SAMPLES, &mut stream) else {
                return Ok(sampled);
            };
            let point = SurfacePoint {
                position,
                normal: mesh.normal(triangle),
                wish: object.regions().wish_at(triangle as u32, position),
            };
            sampled.points.push(point);
            let slant = point.normal.any_orthogonal_vector() * stream.between(-MAX_SLANT, MAX_SLANT)
                + point.normal.cross(point.normal.any_orthogonal_vector())
                    * stream.between(-MAX_SLANT, MAX_SLANT);
            let inward = (slant - point.normal).normalize_or(-point.normal);
            let start = point.position + inward * START_DEPTH;
            let ray = Segment::new(start, start + inward * MAX_THICKNESS);
            let Some(exit) = surface.first_hit(ray) else {
                // Below a sheet lies no volume; it is pressed from both sides at the same point.
                if !surface.contains(start) {
                    sampled.pairs.push(SurfacePair {
                        start: point.position,
                        end: start,
                        thickness: START_DEPTH,
                        wish: point.wish,
                    });
                }
                continue;
            };
            let opposite = mesh.normal(exit.triangle as usize);
            if object.is_forbidden(exit.triangle)
                || opposite.dot(inward) < MIN_COS
                || -point.normal.dot(inward) < MIN_COS
            {
                continue;
            }
            sampled.pairs.push(SurfacePair {
                start: point.position,
                end: exit.position,
                thickness: exit.distance + START_DEPTH,
                wish: 0.5 * (point.wish + object.regions().wish_at(exit.triangle, exit.position)),
            });
        }
        sampled.pairs.shrink_to_fit();
        sampled.points.shrink_to_fit();
        Ok(sampled)
    }

    /// The pairs and points that are not too close to a barrier. Filtering pays off only if many draws follow.
    #[must_use]
    pub fn free_of(&self, barriers: Barriers<'_>) -> Self {
        self.filtered(
            |pair| pair.is_free_of(barriers),
            |point| point.is_free_of(barriers),
        )
    }

    /// The pairs and points where the object's owner wants hands at least this much.
    #[must_use]
    pub fn wanted(&self, least: f32) -> Self {
        self.filtered(|pair| pair.wish >= least, |point| point.wish >= least)
    }

    fn filtered(
        &self,
        has_pair: impl Fn(&SurfacePair) -> bool,
        has_point: impl Fn(&SurfacePoint) -> bool,
    ) -> Self {
        let pairs = self.pairs.iter().filter(|pair| has_pair(pair));
        let points = self.points.iter().filter(|point| has_point(point));
        Self {
            pairs: pairs.copied().collect(),
            points: points.copied().collect(),
        }
    }

    /// Share of the surface that lies opposite a part within a hand's span, from 0 to 1.
    pub fn spanned_share(&self) -> f32 {
        self.pairs.len() as f32 / self.points.len().max(1) as f32
    }

    /// Size of pairs and points, in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.pairs.as_slice()) + size_of_val(self.points.as_slice())
    }

    /// Draws a pair in a random direction; `None` if there are none.
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

    /// Draws a point; `None` if there are none.
    pub fn point(&self, stream: &mut AttemptStream) -> Option<SurfacePoint> {
        (!self.points.is_empty()).then(|| self.points[stream.below(self.points.len())])
    }
}

/// Bounds on the places where an object may be held, in its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoldableSurface {
    /// A box around the surface that may be touched; `None` if all of it is forbidden.
    pub region: Option<OrientedBox>,
    /// Lower bound on the distance, in metres, between two places that may be touched and whose normals are more than a right
    /// angle apart. `None` if some are close, or if unknown.
    pub width: Option<f32>,
    /// The same for the whole surface, forbidden or not.
    pub width_of_all: Option<f32>,
    /// Share of the surface's area that is forbidden, from 0 to 1.
    pub forbidden_share: f32,
}

impl HoldableSurface {
    /// The bounds of an object with these pairs. Objects that a hand spans take microseconds, others some milliseconds;
    /// forbidden surfaces add the time of a bounding box.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of(object: &GraspObject, pairs: &SurfacePairs, stop: Stop<'_>) -> Result<Self, Stopped> {
        let mesh = object.surface.mesh();
        let is_allowed = |triangle: u32| !object.is_forbidden(triangle);
        let forbidden_area = object
            .forbidden_surface()
            .map_or(0.0, |surface| surface.mesh().area());
        let region = if object.forbidden_count() == 0 {
            Some(object.bounding_box)
        } else {
            mesh.submesh(|triangle| is_allowed(triangle as u32))
                .map(|allowed| OrientedBox::around_until(&allowed, stop))
                .transpose()?
        };
        let mut holdable = Self {
            region,
            width: None,
            width_of_all: None,
            forbidden_share: (forbidden_area / mesh.area()) as f32,
        };
        // Every pair of surface points opposes, and most objects have close ones.
        if pairs.pairs.is_empty() && is_oriented(object) {
            holdable.width = lower_bound(opposed_distance(mesh, is_allowed, CLOSE, FAR, stop)?);
            holdable.width_of_all = if object.forbidden_count() == 0 {
                holdable.width
            } else {
                lower_bound(opposed_distance(mesh, |_| true, CLOSE, FAR, stop)?)
            };
        }
        Ok(holdable)
    }
}

/// True if all normals point to the same side of the surface: it is closed, wound consistently and in one piece.
fn is_oriented(object: &GraspObject) -> bool {
    let topology = Topology::of(object.surface.mesh());
    topology.is_closed()
        && topology.is_consistently_wound()
        && topology.non_manifold_edges == 0
        && topology.components == 1
}

fn lower_bound(distance: OpposedDistance) -> Option<f32> {
    match distance {
        OpposedDistance::CloseOrUnknown => None,
        OpposedDistance::Apart(metres) => Some(metres * (1.0 - OPPOSED_ACCURACY)),
        OpposedDistance::BeyondLimit => Some(FAR),
    }
}
