//! Checks what a request asks to keep clear of in addition to the presenting hand: other hands and obstacles.

use glam::{Quat, Vec3};
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::oriented_box::OrientedBox,
    model::{obstacle::Obstacle, strategy::Validity},
};

use super::{
    Field, check_count,
    frames::Frames,
    hand::{GiverHand, check_meshes_together, presenting_hands},
    shapes::{Shape, parts, shape},
};

/// Largest number of hands in addition to the presenting one: the giver's other hand, and both of another person.
const MAX_OTHER_HANDS: usize = 3;

/// Largest number of obstacles. Each is compared with every hand that a search tries, at up to a microsecond each.
/// A tube counts as its parts between two points.
const MAX_OBSTACLES: usize = 64;

/// How far a half-space reaches beyond the object in all directions, in metres: farther than any hand or arm.
const HALF_SPACE_REACH: f32 = 10.0;

/// Solids to keep clear of.
#[derive(Debug, Default)]
pub(super) struct Obstacles {
    pub solids: Vec<Obstacle>,
    /// The place in the request of each of them.
    pub places: Vec<usize>,
}

/// The hands beside the presenting one, in the client's frame and `OpenXR` axes, without those that are wrong.
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

/// The obstacles, in the client's frame and `OpenXR` axes, without those that are wrong.
pub(super) fn obstacles(
    field: Field<'_>,
    sent: &[v1::Shape],
    validity: Validity,
    frames: &Frames<'_>,
) -> Obstacles {
    let count = sent.iter().map(parts).sum();
    let are_few = check_count(field, count, MAX_OBSTACLES, "elements");
    check_validity(field, count, validity);
    let mut obstacles = Obstacles::default();
    if !are_few {
        return obstacles;
    }
    for (place, sent) in sent.iter().enumerate() {
        let solids = match shape(field.at(place), sent, frames.convention) {
            None => continue,
            Some(Shape::Tube(capsules)) => capsules.into_iter().map(Obstacle::Capsule).collect(),
            Some(Shape::Box(solid)) => vec![Obstacle::Box(solid)],
            Some(Shape::HalfSpace { point, normal }) => {
                let object = frames.client_from_object.position;
                vec![Obstacle::Box(box_beyond(point, normal, object))]
            }
        };
        let count = obstacles.places.len() + solids.len();
        obstacles.places.resize(count, place);
        obstacles.solids.extend(solids);
    }
    obstacles
}

/// Checks that a list that only PHYSICAL validity knows is empty under another one.
fn check_validity(field: Field<'_>, count: usize, validity: Validity) {
    if count > 0 && validity == Validity::Thesis {
        field.add("is not empty; thesis_validity knows only presenting_hand: leave one of them out");
    }
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
    use grasp_proto::v1::shape::Kind;
    use grasp_synthesis::geometry::{solid_box::SolidBox, tapered_capsule::TaperedCapsule};
    use proptest::prelude::{Just, Strategy, any, prop_oneof};

    use super::*;
    use crate::{
        convention::Convention,
        rigs::store::RigStore,
        validate::testing::{CONVENTIONS, read_at},
    };

    /// Up to two obstacles as a client may send them, most of them valid.
    pub(crate) fn any_obstacles() -> impl Strategy<Value = Vec<v1::Shape>> {
        let size = || prop_oneof![200 => 0.001_f32..0.5, 1 => any::<f32>(), 1 => Just(0.0)];
        let place =
            || (-0.5_f32..0.5, -0.5_f32..0.5, -0.5_f32..0.5).prop_map(|(x, y, z)| v1::Vector3 { x, y, z });
        let solid = (place(), size(), size(), size()).prop_map(|(position, x, y, z)| {
            Kind::Box(v1::BoxShape {
                pose: Some(v1::Pose {
                    position: Some(position),
                    orientation: None,
                }),
                half_extents: Some(v1::Vector3 { x, y, z }),
            })
        });
        let ball = (place(), size());
        let tube = proptest::collection::vec(ball, 1..5).prop_map(|balls| {
            let (points, radii) = balls.into_iter().unzip();
            Kind::Tube(v1::TubeShape { points, radii })
        });
        // Beyond the object, mostly.
        let half_space = (place(), 0.2_f32..1.0).prop_map(|(point, distance)| {
            let normal = Vec3::from(point);
            Kind::HalfSpace(v1::HalfSpaceShape {
                point: Some((distance * normal.normalize_or_zero()).into()),
                normal: Some(point),
            })
        });
        let obstacle = prop_oneof![3 => solid, 3 => tube, 1 => half_space]
            .prop_map(|kind| v1::Shape { kind: Some(kind) });
        proptest::collection::vec(obstacle, 0..3)
    }

    const OBJECT: Vec3 = Vec3::new(0.2, 1.1, -0.3);

    fn shape(kind: Kind) -> v1::Shape {
        v1::Shape { kind: Some(kind) }
    }

    /// The obstacles, or the fields of their violations.
    fn read(sent: &[v1::Shape], convention: Convention) -> Result<Obstacles, Vec<String>> {
        let frames = Frames {
            convention,
            client_from_object: Pose::from_position(OBJECT),
            rigs: &RigStore::new(1, None),
        };
        match read_at("obstacles", |field| {
            obstacles(field, sent, Validity::Physical, &frames)
        }) {
            (read, blamed) if blamed.is_empty() => Ok(read),
            (_, blamed) => Err(blamed),
        }
    }

    fn a_box() -> OrientedBox {
        OrientedBox {
            object_from_box: Pose::new(
                Vec3::new(0.3, -0.2, 0.7),
                Quat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0),
            ),
            half_extents: Vec3::new(0.1, 0.25, 0.6),
        }
    }

    /// The corners of a box, by its definition: the pose applied to every combination of half extents.
    fn corners(pose: Pose, half_extents: Vec3) -> Vec<Vec3> {
        let signs = [-1.0, 1.0];
        let mut corners = Vec::new();
        for x in signs {
            for y in signs {
                for z in signs {
                    corners.push(pose.transform_point(half_extents * Vec3::new(x, y, z)));
                }
            }
        }
        corners
    }

    /// The axes of each engine in `OpenXR` axes, written independently of [`Convention`].
    fn openxr_point(convention: Convention, p: Vec3) -> Vec3 {
        match convention {
            Convention::OpenXr | Convention::Godot => p,
            Convention::Unity | Convention::UnityFlipX => Vec3::new(p.x, p.y, -p.z),
            Convention::Unreal | Convention::UnrealXzy => Vec3::new(p.y, p.z, -p.x) * 0.01,
        }
    }

    #[test]
    fn boxes_and_tubes_keep_their_place_and_size_in_every_convention() {
        // A box as an engine describes it: a pose and half extents along the axes of the engine's frame.
        for convention in CONVENTIONS {
            let unit = convention.length_from_openxr(1.0);
            let OrientedBox {
                object_from_box: pose,
                half_extents,
            } = a_box();
            let (engine_pose, engine_sizes) = (
                Pose::new(pose.position * unit, pose.orientation),
                half_extents * unit,
            );
            let sent = [
                shape(Kind::Box(v1::BoxShape {
                    pose: Some(v1::Pose::new(engine_pose.position, engine_pose.orientation)),
                    half_extents: Some(engine_sizes.into()),
                })),
                shape(Kind::Tube(v1::TubeShape {
                    points: vec![engine_pose.position.into(), engine_sizes.into()],
                    radii: vec![0.05 * unit, 0.02 * unit],
                })),
            ];
            let read = read(&sent, convention).expect("they are right");
            let [Obstacle::Box(read_box), Obstacle::Capsule(read_capsule)] = read.solids[..] else {
                panic!("{convention:?} {read:?}");
            };
            let expected = corners(engine_pose, engine_sizes);
            let read_corners = corners(read_box.object_from_box, read_box.half_extents);
            for corner in expected.into_iter().map(|p| openxr_point(convention, p)) {
                let nearest = read_corners.iter().map(|read| read.distance(corner));
                let nearest = nearest.fold(f32::INFINITY, f32::min);
                assert!(nearest < 1e-5, "{convention:?} {corner} {nearest}");
            }
            let start = openxr_point(convention, engine_pose.position);
            let end = openxr_point(convention, engine_sizes);
            assert!(read_capsule.start.distance(start) < 1e-6, "{convention:?}");
            assert!(read_capsule.end.distance(end) < 1e-6, "{convention:?}");
            assert!((read_capsule.start_radius - 0.05).abs() < 1e-6, "{convention:?}");
            assert!((read_capsule.end_radius - 0.02).abs() < 1e-6, "{convention:?}");
        }
    }

    #[test]
    fn a_tube_is_a_ball_or_a_capsule_between_every_two_points() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0)];
        let tube = |count: usize, radii: &[f32]| {
            shape(Kind::Tube(v1::TubeShape {
                points: points[..count].iter().map(|&point| point.into()).collect(),
                radii: radii.to_vec(),
            }))
        };
        let sent = [tube(1, &[0.04]), tube(3, &[0.04]), tube(3, &[0.01, 0.02, 0.03])];
        let read = read(&sent, Convention::OpenXr).expect("they are right");
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
        assert_eq!(read.solids, expected);
        assert_eq!(read.places, [0, 1, 1, 2, 2]);
    }

    #[test]
    fn a_half_space_is_on_one_side_of_its_plane_in_every_convention() {
        let (on, inward) = (Vec3::new(3.0, 0.4, -1.0), Vec3::new(0.0, -0.8, 0.6));
        for convention in CONVENTIONS {
            let sent = shape(Kind::HalfSpace(v1::HalfSpaceShape {
                point: Some(convention.point_from_openxr(on).into()),
                normal: Some((7.0 * convention.direction_from_openxr(inward)).into()),
            }));
            let read = read(&[sent], convention).expect("it is right");
            let [Obstacle::Box(solid)] = &read.solids[..] else {
                panic!("{read:?}");
            };
            let solid = SolidBox::new(solid);
            for beside in [Vec3::ZERO, Vec3::X, Vec3::NEG_Y, Vec3::new(-1.0, 2.0, 1.5)] {
                let at = OBJECT + beside;
                let distance = (on - at).dot(inward);
                let found = solid.signed_distance(at);
                assert!(
                    (found - distance).abs() < 1e-5,
                    "{convention:?} {at}: {found} {distance}"
                );
            }
        }
        // Also for an object deep inside.
        let sent = shape(Kind::HalfSpace(v1::HalfSpaceShape {
            point: Some(Vec3::new(0.0, 500.0, 0.0).into()),
            normal: Some(Vec3::NEG_Y.into()),
        }));
        let read = read(&[sent], Convention::OpenXr).expect("it is right");
        let [Obstacle::Box(solid)] = &read.solids[..] else {
            panic!("{read:?}");
        };
        let found = SolidBox::new(solid).signed_distance(OBJECT);
        assert!((found - (OBJECT.y - 500.0)).abs() < 1e-3, "{found}");
    }
}
