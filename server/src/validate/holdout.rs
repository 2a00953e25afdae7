//! Checks `Holdout` and `OutputOptions`: the frames of a request and its answer, and the surroundings of the object.

use std::ops::RangeInclusive;

use glam::{Quat, Vec3};
use grasp_proto::v1::{self, shape::Kind};
use grasp_synthesis::{
    base::pose::Pose,
    geometry::{boxes::OrientedBox, tapered_capsule::TaperedCapsule},
    model::{holdout::Obstacle, strategy::Validity},
};

use super::{
    FARTHEST, Field, FindQuery, GiverHand, Violations, check_count, check_positive, direction, factor,
    finite,
    hand::{check_meshes_together, presenting_hand, presenting_hands},
    known,
    object::{MAX_MASS, object_id_of},
    point, pose, required,
};
use crate::{convention::Convention, rigs::store::RigStore};

/// Allowed sizes of an object relative to its mesh.
const OBJECT_SCALES: RangeInclusive<f32> = 0.25..=4.0;

#[derive(Clone, Copy, Debug)]
pub(super) struct Frames<'a> {
    pub convention: Convention,
    /// The object in the client's frame, in `OpenXR` axes.
    pub client_from_object: Pose,
    pub rigs: &'a RigStore,
}

impl<'a> Frames<'a> {
    /// The frames of a request; violations are dropped.
    pub(super) fn of(
        holdout: Option<&v1::Holdout>,
        sent: Option<v1::OutputOptions>,
        rigs: &'a RigStore,
    ) -> Self {
        let unsaid = Violations::default();
        let field = unsaid.field("output");
        let convention = convention_of_output(field, sent.unwrap_or_default());
        let sent = holdout.and_then(|holdout| holdout.client_from_object);
        Self {
            convention,
            client_from_object: convention.object_to_openxr(pose(field, sent, convention)),
            rigs,
        }
    }

    pub(super) fn of_query(query: &FindQuery, rigs: &'a RigStore) -> Self {
        Self {
            convention: query.convention,
            client_from_object: query.client_from_object,
            rigs,
        }
    }
}

pub(super) fn convention_of_output(field: Field<'_>, sent: v1::OutputOptions) -> Convention {
    Convention::from_wire(known(field.child("convention"), sent.convention))
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RequestedSize {
    /// Hundredths of the size of its mesh.
    pub hundredths: u16,
    /// Mass in kilograms; `None` for that of the same material.
    pub mass: Option<f32>,
}

/// An object, its pose and surroundings, in the client's frame and `OpenXR` axes.
#[derive(Debug)]
pub(super) struct Holdout {
    pub object_id: Option<String>,
    pub object_size: RequestedSize,
    pub client_from_object: Pose,
    /// Origin of the object; `None` if its pose is wrong.
    pub origin: Option<Vec3>,
    pub presenting_hand: Option<GiverHand>,
    pub other_hands: Vec<GiverHand>,
    pub obstacles: Vec<Obstacle>,
    /// The place in the request of each of them.
    pub obstacle_places: Vec<usize>,
    pub up: Vec3,
}

pub(super) fn holdout(
    field: Field<'_>,
    sent: v1::Holdout,
    validity: Validity,
    (convention, rigs): (Convention, &RigStore),
) -> Holdout {
    let object_id = object_id_of(field.child("object"), &sent.object);
    let object_size = object_size(field, sent.scale, sent.mass_kg);
    let pose_field = field.child("client_from_object");
    let read_pose = || convention.object_to_openxr(pose(pose_field, sent.client_from_object, convention));
    let client_from_object = pose_field.if_right(read_pose);
    let frames = Frames {
        convention,
        client_from_object: client_from_object.unwrap_or(Pose::IDENTITY),
        rigs,
    };
    let presenting_field = field.child("presenting_hand");
    let presenting_hand = sent
        .presenting_hand
        .and_then(|sent| presenting_hand(presenting_field, sent, &frames));
    let of_others = (presenting_hand.as_ref(), sent.other_hands);
    let other_hands = other_hands(field.child("other_hands"), of_others, validity, &frames);
    let obstacles_field = field.child("obstacles");
    let (obstacles, obstacle_places) = obstacles(obstacles_field, &sent.obstacles, validity, &frames);
    let up = sent.up;
    let up = up.and_then(|up| direction(field.child("up"), up, convention));
    Holdout {
        object_id,
        object_size,
        client_from_object: frames.client_from_object,
        origin: client_from_object.map(|pose| pose.position),
        other_hands,
        presenting_hand,
        obstacles,
        obstacle_places,
        up: up.unwrap_or(Vec3::Y),
    }
}

/// The size of the object; that of its mesh if it is wrong.
fn object_size(holdout: Field<'_>, scale: Option<f32>, mass: Option<f32>) -> RequestedSize {
    let scale = factor(holdout.child("scale"), scale, OBJECT_SCALES);
    if let Some(mass) = mass {
        check_positive(holdout.child("mass_kg"), mass, MAX_MASS);
    }
    RequestedSize {
        hundredths: (100.0 * scale).round() as u16,
        mass,
    }
}

const MAX_POINTS: usize = 64;

/// Largest number of hands in addition to the presenting one: the giver's other hand, and both of another person.
const MAX_OTHER_HANDS: usize = 3;

/// Largest number of obstacles, where a tube counts as its parts: each is compared with every hand that a search tries, at up to
/// a microsecond each.
const MAX_OBSTACLES: usize = 64;

/// How far a half-space reaches beyond the object in all directions, in metres: farther than any hand or arm.
const HALF_SPACE_REACH: f32 = 10.0;

pub(super) enum Shape {
    /// The capsules between the points of a tube; a single one is a ball.
    Tube(Vec<TaperedCapsule>),
    Box(OrientedBox),
    /// Everything beyond a plane, on the side of its unit normal.
    HalfSpace {
        point: Vec3,
        normal: Vec3,
    },
}

pub(super) fn shape(field: Field<'_>, sent: &v1::Shape, convention: Convention) -> Option<Shape> {
    match &sent.kind {
        None => field.reject("is empty; it must have a tube, a box or a half_space"),
        Some(Kind::Tube(sent)) => tube(field.child("tube"), sent, convention).map(Shape::Tube),
        Some(Kind::Box(sent)) => solid_box(field.child("box"), sent, convention).map(Shape::Box),
        Some(Kind::HalfSpace(sent)) => half_space(field.child("half_space"), sent, convention),
    }
}

pub(super) fn parts(sent: &v1::Shape) -> usize {
    match &sent.kind {
        Some(Kind::Tube(tube)) => tube.points.len().saturating_sub(1).max(1),
        _ => 1,
    }
}

fn tube(field: Field<'_>, sent: &v1::TubeShape, convention: Convention) -> Option<Vec<TaperedCapsule>> {
    let (count, radii) = (sent.points.len(), sent.radii.len());
    let points_field = field.child("points");
    let radii_field = field.child("radii");
    let largest = convention.length_from_openxr(FARTHEST);
    let points = field.if_right(|| {
        let text = format_args!("has {count} points; it must have 1 to {MAX_POINTS}");
        let is_count_right = points_field.check((1..=MAX_POINTS).contains(&count), text);
        if !check_count(radii_field, radii, MAX_POINTS, "elements") {
            return Vec::new();
        }
        radii_field.check(
            !is_count_right || [1, count].contains(&radii),
            format_args!(
                "has {radii} elements; it must have one for all points, or one for each of the {count}"
            ),
        );
        let points = sent.points.iter().take(MAX_POINTS);
        let points: Vec<Vec3> = points_field
            .each(points, |field, &sent| point(field, sent, convention))
            .collect();
        for (place, &radius) in sent.radii.iter().enumerate() {
            check_positive(radii_field.at(place), radius, largest);
        }
        points
    })?;
    let radii = sent.radii.iter().cycle();
    let radii = radii.map(|&radius| convention.length_to_openxr(radius));
    let balls: Vec<(Vec3, f32)> = points.into_iter().zip(radii).collect();
    let capsule =
        |(start, start_radius), (end, end_radius)| TaperedCapsule::new(start, end, start_radius, end_radius);
    Some(match balls[..] {
        [ball] => vec![capsule(ball, ball)],
        _ => balls
            .array_windows()
            .map(|&[start, end]| capsule(start, end))
            .collect(),
    })
}

fn half_space(field: Field<'_>, sent: &v1::HalfSpaceShape, convention: Convention) -> Option<Shape> {
    field.if_right(|| {
        let on = sent.point.map(|on| point(field.child("point"), on, convention));
        let normal_field = field.child("normal");
        Some(Shape::HalfSpace {
            point: on.unwrap_or(Vec3::ZERO),
            normal: direction(normal_field, required(normal_field, sent.normal)?, convention)?,
        })
    })?
}

fn solid_box(field: Field<'_>, sent: &v1::BoxShape, convention: Convention) -> Option<OrientedBox> {
    let client_from_box = pose(field.child("pose"), sent.pose, convention);
    let sizes_field = field.child("half_extents");
    let sent = required(sizes_field, sent.half_extents)?;
    let half_extents = sizes_field.if_right(|| finite(sizes_field, sent));
    if let Some(half_extents) = half_extents {
        // Only the first wrong size is reported.
        let mut sizes = half_extents.to_array().into_iter();
        sizes.all(|size| check_positive(sizes_field, size, convention.length_from_openxr(FARTHEST)));
    }
    Some(OrientedBox {
        object_from_box: convention.pose_to_openxr(client_from_box),
        // The conversion permutes and mirrors axes; sizes have no sign.
        half_extents: convention.point_to_openxr(half_extents.unwrap_or_default()).abs(),
    })
}

/// The hands beside the presenting one, in the client's frame and `OpenXR` axes, without wrong ones.
pub(super) fn other_hands(
    field: Field<'_>,
    (presenting, sent): (Option<&GiverHand>, Vec<v1::PresentingHand>),
    validity: Validity,
    frames: &Frames<'_>,
) -> Vec<GiverHand> {
    check_count(field, sent.len(), MAX_OTHER_HANDS, "elements");
    check_validity(field, sent.len(), validity);
    let hands = presenting_hands(field, sent, MAX_OTHER_HANDS, frames);
    check_meshes_together(field, presenting.into_iter().chain(&hands));
    hands
}

/// The obstacles, in the client's frame and `OpenXR` axes, without wrong ones, and the place of each in the request.
pub(super) fn obstacles(
    field: Field<'_>,
    sent: &[v1::Shape],
    validity: Validity,
    frames: &Frames<'_>,
) -> (Vec<Obstacle>, Vec<usize>) {
    let count = sent.iter().map(parts).sum();
    let are_few = check_count(field, count, MAX_OBSTACLES, "elements");
    check_validity(field, count, validity);
    let (mut obstacles, mut places) = (Vec::new(), Vec::new());
    if !are_few {
        return (obstacles, places);
    }
    for (place, sent) in sent.iter().enumerate() {
        match shape(field.at(place), sent, frames.convention) {
            None => continue,
            Some(Shape::Tube(capsules)) => {
                let capsules = capsules.into_iter().map(Obstacle::Capsule);
                obstacles.extend(capsules);
            }
            Some(Shape::Box(solid)) => obstacles.push(Obstacle::Box(solid)),
            Some(Shape::HalfSpace { point, normal }) => {
                let beyond = box_beyond(point, normal, frames.client_from_object.position);
                obstacles.push(Obstacle::Box(beyond));
            }
        }
        places.resize(obstacles.len(), place);
    }
    (obstacles, places)
}

/// Checks that a list that only PHYSICAL validity knows is empty under another one.
fn check_validity(field: Field<'_>, count: usize, validity: Validity) {
    let text = "is not empty; thesis_validity knows only presenting_hand: leave one of them out";
    field.check(count == 0 || validity == Validity::Physical, text);
}

/// A half-space as a box that reaches beyond everything that a hand at the object can touch.
fn box_beyond(point: Vec3, inward: Vec3, object: Vec3) -> OrientedBox {
    let depth = (object - point).dot(inward);
    let half_edge = HALF_SPACE_REACH + depth.max(0.0);
    OrientedBox {
        object_from_box: Pose {
            position: object + (half_edge - depth) * inward,
            orientation: Quat::from_rotation_arc(Vec3::Y, inward),
        },
        half_extents: Vec3::splat(half_edge),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use grasp_synthesis::geometry::boxes::SolidBox;
    use proptest::prelude::{Just, Strategy, any, prop_oneof};

    use super::*;
    use crate::{rigs::store::RigStore, validate::fixtures::read_at};

    /// Up to two obstacles as a client may send them, most of them valid.
    pub(crate) fn any_obstacles() -> impl Strategy<Value = Vec<v1::Shape>> {
        let size = || prop_oneof![200 => 0.001_f32..0.5, 1 => any::<f32>(), 1 => Just(0.0)];
        let place = || (-0.5_f32..0.5, -0.5_f32..0.5, -0.5_f32..0.5).prop_map(Vec3::from);
        let solid = (place(), size(), size(), size()).prop_map(|(position, x, y, z)| {
            let pose = v1::Pose::new(position, Quat::IDENTITY);
            v1::Shape::solid_box(pose, Vec3::new(x, y, z))
        });
        let ball = (place(), size());
        let tube = proptest::collection::vec(ball, 1..5).prop_map(|balls| {
            let (points, radii): (Vec<Vec3>, _) = balls.into_iter().unzip();
            tapered(&points, radii)
        });
        // Beyond the object, mostly.
        let half_space = (place(), 0.2_f32..1.0)
            .prop_map(|(point, distance)| v1::Shape::half_space(distance * point.normalize_or_zero(), point));
        let obstacle = prop_oneof![3 => solid, 3 => tube, 1 => half_space];
        proptest::collection::vec(obstacle, 0..3)
    }

    fn tapered(points: &[Vec3], radii: Vec<f32>) -> v1::Shape {
        let points = points.iter().map(|&point| point.into()).collect();
        v1::Shape {
            kind: Some(Kind::Tube(v1::TubeShape { points, radii })),
        }
    }

    const OBJECT: Vec3 = Vec3::new(0.2, 1.1, -0.3);

    fn read(sent: &[v1::Shape]) -> (Vec<Obstacle>, Vec<usize>) {
        let frames = Frames {
            convention: Convention::OpenXr,
            client_from_object: Pose::from_position(OBJECT),
            rigs: &RigStore::new(1, None),
        };
        let (read, blamed) = read_at("obstacles", |field| {
            obstacles(field, sent, Validity::Physical, &frames)
        });
        assert!(blamed.is_empty(), "{blamed:?}");
        read
    }

    #[test]
    fn a_tube_is_a_ball_or_a_capsule_between_every_two_points() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0)];
        let tube = |count: usize, radii: &[f32]| tapered(&points[..count], radii.to_vec());
        let sent = [tube(1, &[0.04]), tube(3, &[0.04]), tube(3, &[0.01, 0.02, 0.03])];
        let (solids, places) = read(&sent);
        let expected = [
            (0, 0, 0.04, 0.04),
            (0, 1, 0.04, 0.04),
            (1, 2, 0.04, 0.04),
            (0, 1, 0.01, 0.02),
            (1, 2, 0.02, 0.03),
        ];
        let expected = expected.map(|(start, end, start_radius, end_radius)| {
            let (start, end) = (points[start], points[end]);
            Obstacle::Capsule(TaperedCapsule::new(start, end, start_radius, end_radius))
        });
        assert_eq!(solids, expected);
        assert_eq!(places, [0, 1, 1, 2, 2]);
    }

    #[test]
    fn a_half_space_is_on_one_side_of_its_plane() {
        let inward = Vec3::new(0.0, -0.8, 0.6);
        // Also for an object deep inside.
        for on in [Vec3::new(3.0, 0.4, -1.0), OBJECT - 500.0 * inward] {
            let (solids, _) = read(&[v1::Shape::half_space(on, 7.0 * inward)]);
            let [Obstacle::Box(solid)] = &solids[..] else {
                panic!("{solids:?}");
            };
            let solid = SolidBox::new(solid);
            for beside in [Vec3::ZERO, Vec3::X, Vec3::NEG_Y, Vec3::new(-1.0, 2.0, 1.5)] {
                let at = OBJECT + beside;
                let distance = (on - at).dot(inward);
                let found = solid.signed_distance(at);
                assert!((found - distance).abs() < 1e-3, "{at}: {found} {distance}");
            }
        }
    }

    #[test]
    fn scales_are_rounded_to_hundredths() {
        for (scale, hundredths) in [
            (None, 100),
            (Some(0.25), 25),
            (Some(1.004), 100),
            (Some(1.006), 101),
        ] {
            let (size, blamed) = read_at("holdout", |field| object_size(field, scale, None));
            assert!(size.hundredths == hundredths && blamed.is_empty(), "{size:?}");
        }
    }
}
