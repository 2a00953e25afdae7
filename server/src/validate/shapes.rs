//! Checks shapes: of obstacles and of parts of an object's surface.

use std::fmt::Display;

use glam::Vec3;
use grasp_proto::v1::{self, shape::Kind};
use grasp_synthesis::geometry::{boxes::OrientedBox, tapered_capsule::TaperedCapsule};

use super::{FARTHEST, Field, direction, finite, point, pose, required};
use crate::convention::Convention;

/// Largest number of points of a tube.
const MAX_POINTS: usize = 64;

/// A shape, in `OpenXR` axes and metres.
pub(super) enum Shape {
    /// The capsules between the points of a tube; a single one is a ball.
    Tube(Vec<TaperedCapsule>),
    Box(OrientedBox),
    /// What is beyond a plane, on the side of its unit normal.
    HalfSpace {
        point: Vec3,
        normal: Vec3,
    },
}

/// A shape; `None` if it is wrong.
pub(super) fn shape(field: Field<'_>, sent: &v1::Shape, convention: Convention) -> Option<Shape> {
    match &sent.kind {
        None => field.reject("is empty; it must have a tube, a box or a half_space"),
        Some(Kind::Tube(sent)) => tube(field.child("tube"), sent, convention).map(Shape::Tube),
        Some(Kind::Box(sent)) => solid_box(field.child("box"), sent, convention).map(Shape::Box),
        Some(Kind::HalfSpace(sent)) => half_space(field.child("half_space"), sent, convention),
    }
}

/// Number of shapes as which one counts.
pub(super) fn parts(sent: &v1::Shape) -> usize {
    match &sent.kind {
        Some(Kind::Tube(tube)) => tube.points.len().saturating_sub(1).max(1),
        _ => 1,
    }
}

fn tube(field: Field<'_>, sent: &v1::TubeShape, convention: Convention) -> Option<Vec<TaperedCapsule>> {
    let before = field.violations().len();
    let (count, points_field) = (sent.points.len(), field.child("points"));
    if !(1..=MAX_POINTS).contains(&count) {
        points_field.add(format_args!("has {count} points; it must have 1 to {MAX_POINTS}"));
    }
    let radii_field = field.child("radii");
    if sent.radii.len() > MAX_POINTS {
        return radii_field.reject(format_args!(
            "has {} elements; it must have at most {MAX_POINTS}",
            sent.radii.len()
        ));
    }
    if (1..=MAX_POINTS).contains(&count) && ![1, count].contains(&sent.radii.len()) {
        radii_field.add(format_args!(
            "has {} elements; it must have one for all points, or one for each of the {count}",
            sent.radii.len()
        ));
    }
    let points = sent.points.iter().take(MAX_POINTS).enumerate();
    let points: Vec<Vec3> = points
        .map(|(place, &sent)| point(points_field.at(place), sent, convention))
        .collect();
    for (place, &radius) in sent.radii.iter().enumerate() {
        check_size(radii_field.at(place), radius, radius, convention);
    }
    if field.violations().len() > before {
        return None;
    }
    let radii = sent.radii.iter().cycle();
    let radii = radii.map(|&radius| convention.length_to_openxr(radius));
    let balls: Vec<(Vec3, f32)> = points.into_iter().zip(radii).collect();
    let capsule =
        |(start, start_radius), (end, end_radius)| TaperedCapsule::new(start, end, start_radius, end_radius);
    Some(match balls[..] {
        [ball] => vec![capsule(ball, ball)],
        _ => balls.windows(2).map(|pair| capsule(pair[0], pair[1])).collect(),
    })
}

fn half_space(field: Field<'_>, sent: &v1::HalfSpaceShape, convention: Convention) -> Option<Shape> {
    let before = field.violations().len();
    let on = sent.point.map(|on| point(field.child("point"), on, convention));
    let normal_field = field.child("normal");
    let normal = direction(normal_field, required(normal_field, sent.normal)?, convention)?;
    (field.violations().len() == before).then_some(Shape::HalfSpace {
        point: on.unwrap_or(Vec3::ZERO),
        normal,
    })
}

fn solid_box(field: Field<'_>, sent: &v1::BoxShape, convention: Convention) -> Option<OrientedBox> {
    let client_from_box = pose(field.child("pose"), sent.pose, convention);
    let sizes_field = field.child("half_extents");
    let before = field.violations().len();
    let half_extents = finite(sizes_field, required(sizes_field, sent.half_extents)?);
    if field.violations().len() == before {
        // The first that is wrong shows all of them.
        let mut sizes = half_extents.to_array().into_iter();
        sizes.all(|size| check_size(sizes_field, size, half_extents, convention));
    }
    Some(OrientedBox {
        object_from_box: convention.pose_to_openxr(client_from_box),
        // The conversion permutes and mirrors axes; sizes have no sign.
        half_extents: convention.point_to_openxr(half_extents).abs(),
    })
}

/// True if a size in the client's unit, which the error shows as `sent`, is right.
fn check_size(field: Field<'_>, size: f32, sent: impl Display, convention: Convention) -> bool {
    let largest = convention.length_from_openxr(FARTHEST);
    let is_right = size > 0.0 && size <= largest;
    if !is_right {
        field.add(format_args!(
            "is {sent}; every size must be more than 0 and at most {largest} (1 km)"
        ));
    }
    is_right
}
