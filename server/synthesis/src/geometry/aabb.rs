//! Axis-aligned bounding boxes.

use glam::{Vec3, Vec3A};

use super::Segment;

/// A box whose faces are perpendicular to the axes, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// The corner with the smallest coordinates.
    pub min: Vec3,
    /// The corner with the largest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// The empty box, the neutral element of [`Aabb::including`].
    pub const EMPTY: Self = Self {
        min: Vec3::INFINITY,
        max: Vec3::NEG_INFINITY,
    };

    /// The smallest box around points; [`Aabb::EMPTY`] for none.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::including)
    }

    /// The smallest box around this one and a point.
    #[must_use]
    pub fn including(self, point: Vec3) -> Self {
        Self {
            min: self.min.min(point),
            max: self.max.max(point),
        }
    }

    /// True if the point lies inside or on a face.
    pub fn contains(&self, point: Vec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// False only if the segment certainly misses the box, because all of it lies beyond one face. A conservative
    /// test: it may be true for a segment that misses.
    #[inline]
    pub(crate) fn may_intersect(&self, segment: Segment) -> bool {
        let (start, end) = (Vec3A::from(segment.start), Vec3A::from(segment.end));
        let beyond_max = start.min(end) - Vec3A::from(self.max);
        let below_min = Vec3A::from(self.min) - start.max(end);
        // A single comparison: six unpredictable branches would take longer than all the arithmetic.
        !beyond_max.max(below_min).cmpgt(Vec3A::ZERO).any()
    }

    /// Distance from a point to the box, in metres; 0 inside.
    #[inline]
    pub fn distance(&self, point: Vec3) -> f32 {
        (self.min - point).max(point - self.max).max(Vec3::ZERO).length()
    }

    /// Edge lengths, in metres.
    pub fn extents(&self) -> Vec3 {
        self.max - self.min
    }

    /// The centre.
    pub fn centre(&self) -> Vec3 {
        // Halve before adding: the sum of two huge coordinates would overflow.
        self.min * 0.5 + self.max * 0.5
    }

    /// Length of the diagonal, in metres.
    pub fn diagonal(&self) -> f32 {
        self.extents().length()
    }
}
