//! Parts of space that mark parts of a surface.

use glam::Vec3;

use super::{
    Segment,
    boxes::OrientedBox,
    closest::{distance_of_point, distance_of_segment},
    tapered_capsule::{TaperedCapsule, least_along},
};
use crate::base::pose::Pose;

/// Steps of the search along a capsule's axis, each of which leaves two thirds of it: a metre becomes a micrometre.
const AXIS_STEPS: usize = 35;

/// A part of space in the object's frame, with its boundary.
#[derive(Clone, Debug, PartialEq)]
pub enum Zone {
    /// All points within a distance of one.
    Ball {
        /// The centre, in metres.
        centre: Vec3,
        /// The radius in metres; more than 0.
        radius: f32,
    },
    /// The inside of a box.
    Box(OrientedBox),
    /// One side of a plane.
    HalfSpace {
        /// A point of the plane, in metres.
        point: Vec3,
        /// Unit vector from the plane into the half-space.
        normal: Vec3,
    },
    /// All points within a distance of a line of segments.
    Tube {
        /// The ends of the segments, in metres; at least two.
        points: Vec<Vec3>,
        /// The distance in metres; more than 0.
        radius: f32,
    },
    /// The same with a distance that varies along each segment.
    TaperedTube(Vec<TaperedCapsule>),
}

impl Zone {
    /// The same zone, `scale` times as large about the origin.
    #[must_use]
    pub fn scaled(&self, scale: f32) -> Self {
        match self {
            Self::Ball { centre, radius } => Self::Ball {
                centre: *centre * scale,
                radius: radius * scale,
            },
            Self::Box(of) => Self::Box(of.scaled(scale)),
            Self::HalfSpace { point, normal } => Self::HalfSpace {
                point: *point * scale,
                normal: *normal,
            },
            Self::Tube { points, radius } => Self::Tube {
                points: points.iter().map(|&point| point * scale).collect(),
                radius: radius * scale,
            },
            Self::TaperedTube(parts) => {
                Self::TaperedTube(parts.iter().map(|part| part.scaled(scale)).collect())
            }
        }
    }

    /// Numbers by which zones differ.
    pub fn numbers(&self) -> Vec<f32> {
        match self {
            Self::Ball { centre, radius } => [&centre.to_array()[..], &[*radius]].concat(),
            Self::Box(of) => {
                let Pose {
                    position,
                    orientation,
                } = of.object_from_box;
                [
                    &position.to_array()[..],
                    &orientation.to_array(),
                    &of.half_extents.to_array(),
                ]
                .concat()
            }
            Self::HalfSpace { point, normal } => [point.to_array(), normal.to_array()].concat(),
            Self::Tube { points, radius } => {
                let points = points.iter().flat_map(Vec3::to_array);
                points.chain([*radius]).collect()
            }
            Self::TaperedTube(parts) => {
                let numbers = |part: &TaperedCapsule| {
                    [
                        &part.start.to_array()[..],
                        &part.end.to_array(),
                        &[part.start_radius, part.end_radius],
                    ]
                    .concat()
                };
                parts.iter().flat_map(numbers).collect()
            }
        }
    }

    /// True if a point is in the zone.
    pub fn contains(&self, point: Vec3) -> bool {
        match self {
            Self::Ball { centre, radius } => point.distance_squared(*centre) <= radius * radius,
            Self::Box(of) => of.contains(point),
            Self::HalfSpace { point: on, normal } => (point - on).dot(*normal) >= 0.0,
            Self::Tube { points, radius } => points.windows(2).any(|ends| {
                let along = ends[1] - ends[0];
                let share = (point - ends[0]).dot(along) / along.length_squared().max(f32::MIN_POSITIVE);
                let nearest = ends[0] + along * share.clamp(0.0, 1.0);
                point.distance_squared(nearest) <= radius * radius
            }),
            Self::TaperedTube(parts) => parts.iter().any(|part| part.signed_distance(point) <= 0.0),
        }
    }

    /// True if a triangle has a point in the zone.
    pub fn meets(&self, corners: [Vec3; 3]) -> bool {
        match self {
            Self::Ball { centre, radius } => distance_of_point(corners, *centre) <= *radius,
            Self::Box(of) => {
                let box_from_object = of.object_from_box.inverse();
                let local = corners.map(|corner| box_from_object.transform_point(corner));
                reaches_into_box(local, of.half_extents)
            }
            Self::HalfSpace { .. } => corners.iter().any(|&corner| self.contains(corner)),
            Self::Tube { points, radius } => points
                .windows(2)
                .any(|ends| distance_of_segment(corners, Segment::new(ends[0], ends[1])) <= *radius),
            Self::TaperedTube(parts) => parts.iter().any(|part| is_reached(corners, part)),
        }
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        let of_list = match self {
            Self::Tube { points, .. } => size_of_val(points.as_slice()),
            Self::TaperedTube(parts) => size_of_val(parts.as_slice()),
            _ => 0,
        };
        size_of::<Self>() + of_list
    }
}

/// True if a triangle has a point in a capsule.
fn is_reached(corners: [Vec3; 3], capsule: &TaperedCapsule) -> bool {
    let (centre, radius) = capsule.bounding_sphere();
    if distance_of_point(corners, centre) > radius {
        return false;
    }
    // The distance of a triangle from a point of the axis, less the radius there, is convex along the axis.
    let value = |along: f32| distance_of_point(corners, capsule.at(along)) - capsule.radius_at(along);
    [0.0, least_along(AXIS_STEPS, value), 1.0]
        .into_iter()
        .any(|along| value(along) <= 0.0)
}

/// True if a triangle meets a box around the origin, by Sutherland-Hodgman clipping (1974).
fn reaches_into_box(corners: [Vec3; 3], half_extents: Vec3) -> bool {
    let mut polygon = corners.to_vec();
    for axis in 0..3 {
        for side in [1.0, -1.0] {
            let beyond = |point: Vec3| side * point[axis] - half_extents[axis];
            let mut clipped = Vec::with_capacity(polygon.len() + 1);
            for (place, &from) in polygon.iter().enumerate() {
                let to = polygon[(place + 1) % polygon.len()];
                let (before, after) = (beyond(from), beyond(to));
                if before <= 0.0 {
                    clipped.push(from);
                }
                if (before <= 0.0) != (after <= 0.0) {
                    clipped.push(from.lerp(to, before / (before - after)));
                }
            }
            polygon = clipped;
        }
    }
    !polygon.is_empty()
}
