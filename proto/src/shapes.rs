//! Parts of space.

use glam::Vec3;

use crate::{
    v1::{self, shape::Kind},
    values::vector,
};

impl v1::Shape {
    /// A ball.
    #[must_use]
    pub fn ball(center: Vec3, radius: f32) -> Self {
        Self::tube([center], radius)
    }

    /// All points within a radius of a segment.
    #[must_use]
    pub fn capsule(start: Vec3, end: Vec3, radius: f32) -> Self {
        Self::tube([start, end], radius)
    }

    /// All points within a radius of a line through points.
    pub fn tube(points: impl IntoIterator<Item = Vec3>, radius: f32) -> Self {
        Self {
            kind: Some(Kind::Tube(v1::TubeShape {
                points: points.into_iter().map(Into::into).collect(),
                radii: vec![radius],
            })),
        }
    }

    /// A box by its frame and half its edges. A floor is a wide one whose upper face is the ground.
    #[must_use]
    pub fn solid_box(pose: v1::Pose, half_extents: Vec3) -> Self {
        Self {
            kind: Some(Kind::Box(v1::BoxShape {
                pose: Some(pose),
                half_extents: Some(half_extents.into()),
            })),
        }
    }

    /// The side of a plane through a point that a direction points to.
    #[must_use]
    pub fn half_space(point: Vec3, normal: Vec3) -> Self {
        Self {
            kind: Some(Kind::HalfSpace(v1::HalfSpaceShape {
                point: Some(point.into()),
                normal: Some(normal.into()),
            })),
        }
    }
}

impl v1::TubeShape {
    /// The balls around its points, by center and radius; the tube is what they sweep.
    pub fn balls(&self) -> impl Iterator<Item = (Vec3, f32)> {
        let last = self.radii.last().copied().unwrap_or_default();
        let radii = self.radii.iter().copied().chain(std::iter::repeat(last));
        self.points.iter().map(|&point| point.into()).zip(radii)
    }
}

impl v1::BoxShape {
    /// Half its edges.
    #[must_use]
    pub fn half_extents(&self) -> Vec3 {
        vector(self.half_extents)
    }
}
