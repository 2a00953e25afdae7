//! Axis-aligned bounding boxes.

use glam::{Vec3, Vec3A};

use super::Segment;

/// A box with its faces square to the axes, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// The corner with the smallest coordinates.
    pub min: Vec3,
    /// The corner with the largest.
    pub max: Vec3,
}

impl Aabb {
    /// The box that contains nothing; the neutral element of [`Aabb::including`].
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

    /// False only if the segment certainly passes the box: if all of it lies on the outer side of one face.
    #[inline]
    pub fn may_meet(&self, segment: Segment) -> bool {
        let (start, end) = (Vec3A::from(segment.start), Vec3A::from(segment.end));
        let beyond_max = start.min(end) - Vec3A::from(self.max);
        let below_min = Vec3A::from(self.min) - start.max(end);
        // One comparison at the end: six branches that nobody can predict take longer than all the arithmetic.
        !beyond_max.max(below_min).cmpgt(Vec3A::ZERO).any()
    }

    /// Distance from a point in metres; 0 inside.
    #[inline]
    pub fn distance(&self, point: Vec3) -> f32 {
        (self.min - point).max(point - self.max).max(Vec3::ZERO).length()
    }

    /// Edge lengths in metres.
    pub fn extents(&self) -> Vec3 {
        self.max - self.min
    }

    /// The middle.
    pub fn centre(&self) -> Vec3 {
        // Halved first: the sum of two huge coordinates would overflow.
        self.min * 0.5 + self.max * 0.5
    }

    /// Length of the diagonal in metres.
    pub fn diagonal(&self) -> f32 {
        self.extents().length()
    }
}
