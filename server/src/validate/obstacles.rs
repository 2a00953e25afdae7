//! Checks what a request asks to keep clear of in addition to the presenting hand: other hands and obstacles.

use glam::{Quat, Vec3};
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::boxes::OrientedBox,
    model::{holdout::Obstacle, strategy::Validity},
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
    use grasp_synthesis::geometry::{boxes::SolidBox, tapered_capsule::TaperedCapsule};
    use proptest::prelude::{Just, Strategy, any, prop_oneof};

    use super::*;
    use crate::{convention::Convention, rigs::store::RigStore, validate::testing::read_at};

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

    /// The obstacles, all of which are right.
    fn read(sent: &[v1::Shape]) -> Obstacles {
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
        let tube = |count: usize, radii: &[f32]| {
            let kind = Kind::Tube(v1::TubeShape {
                points: points[..count].iter().map(|&point| point.into()).collect(),
                radii: radii.to_vec(),
            });
            v1::Shape { kind: Some(kind) }
        };
        let sent = [tube(1, &[0.04]), tube(3, &[0.04]), tube(3, &[0.01, 0.02, 0.03])];
        let read = read(&sent);
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
    fn a_half_space_is_on_one_side_of_its_plane() {
        let inward = Vec3::new(0.0, -0.8, 0.6);
        // Also for an object deep inside.
        for on in [Vec3::new(3.0, 0.4, -1.0), OBJECT - 500.0 * inward] {
            let sent = v1::Shape::half_space(on, 7.0 * inward);
            let read = read(&[sent]);
            let [Obstacle::Box(solid)] = &read.solids[..] else {
                panic!("{read:?}");
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
}
