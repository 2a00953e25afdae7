//! Checks what a request asks to keep clear of in addition to the presenting hand: other hands and obstacles.

use std::fmt::Display;

use grasp_proto::v1;
use grasp_synthesis::{
    geometry::{oriented_box::OrientedBox, tapered_capsule::TaperedCapsule},
    model::{obstacle::Obstacle, strategy::Validity},
};

use super::{FARTHEST, Field, Violations, finite, hand, hand::GiverHand, point, pose};
use crate::{convention::Convention, rigs::store::RigStore};

/// Largest number of hands in addition to the presenting one: the giver's other hand, and both of another person.
const MAXIMUM_OTHER_HANDS: usize = 3;

/// Largest number of obstacles. Each is compared with every hand that a search tries, at up to a microsecond each.
const MAXIMUM_OBSTACLES: usize = 64;

/// The hands beside the presenting one, in the client's frame and `OpenXR` axes, without those that are wrong.
pub(super) fn other_hands(
    field: Field<'_>,
    (presenting, sent): (Option<&GiverHand>, Vec<v1::PresentingHand>),
    validity: Validity,
    (convention, rigs): (Convention, &RigStore),
    violations: &mut Violations,
) -> Vec<GiverHand> {
    check_count(field, sent.len(), MAXIMUM_OTHER_HANDS, validity, violations);
    let hands: Vec<GiverHand> = sent
        .into_iter()
        .take(MAXIMUM_OTHER_HANDS)
        .enumerate()
        .filter_map(|(place, sent)| {
            hand::presenting_hand(field.at(place), sent, convention, rigs, violations)
        })
        .collect();
    hand::check_meshes_together(field, presenting.into_iter().chain(&hands), violations);
    hands
}

/// The obstacles, in the client's frame and `OpenXR` axes, without those that are wrong.
pub(super) fn obstacles(
    field: Field<'_>,
    sent: &[v1::Obstacle],
    validity: Validity,
    convention: Convention,
    violations: &mut Violations,
) -> Vec<Obstacle> {
    check_count(field, sent.len(), MAXIMUM_OBSTACLES, validity, violations);
    sent.iter()
        .take(MAXIMUM_OBSTACLES)
        .enumerate()
        .filter_map(|(place, sent)| obstacle(field.at(place), sent, convention, violations))
        .collect()
}

/// Checks the length of a list that only PHYSICAL validity knows.
fn check_count(
    field: Field<'_>,
    count: usize,
    maximum: usize,
    validity: Validity,
    violations: &mut Violations,
) {
    if count > maximum {
        violations.add(
            field,
            format_args!("has {count} elements; it may have up to {maximum}"),
        );
    }
    if count > 0 && validity == Validity::Thesis {
        violations.add(
            field,
            "is not empty; VALIDITY_THESIS knows only presenting_hand: leave it empty or use VALIDITY_PHYSICAL",
        );
    }
}

/// An obstacle; none if it is wrong.
fn obstacle(
    field: Field<'_>,
    sent: &v1::Obstacle,
    convention: Convention,
    violations: &mut Violations,
) -> Option<Obstacle> {
    use v1::obstacle::Shape;
    match &sent.shape {
        None => {
            violations.add(field, "is empty; it must have a capsule or a box");
            None
        }
        Some(Shape::Capsule(sent)) => {
            capsule(field.child("capsule"), sent, convention, violations).map(Obstacle::Capsule)
        }
        Some(Shape::Box(sent)) => {
            solid_box(field.child("box"), sent, convention, violations).map(Obstacle::Box)
        }
    }
}

fn capsule(
    field: Field<'_>,
    sent: &v1::CapsuleShape,
    convention: Convention,
    violations: &mut Violations,
) -> Option<TaperedCapsule> {
    let mut end = |name, sent: Option<v1::Vector3>| {
        let place = required(field.child(name), sent, violations)?;
        let place = point(field.child(name), place, convention.metres_per_unit(), violations);
        Some(convention.point_to_openxr(place))
    };
    let (start, end) = (
        end("client_start", sent.client_start),
        end("client_end", sent.client_end),
    );
    let mut radius = |name, radius: f32| {
        check_size(field.child(name), radius, radius, convention, violations);
        convention.length_to_openxr(radius)
    };
    let start_radius = radius("radius", sent.radius);
    let end_radius = sent
        .end_radius
        .map_or(start_radius, |end_radius| radius("end_radius", end_radius));
    Some(TaperedCapsule::new(start?, end?, start_radius, end_radius))
}

fn solid_box(
    field: Field<'_>,
    sent: &v1::BoxShape,
    convention: Convention,
    violations: &mut Violations,
) -> Option<OrientedBox> {
    let unit = convention.metres_per_unit();
    let client_from_box = pose(
        field.child("client_from_box"),
        sent.client_from_box,
        unit,
        violations,
    );
    let sizes_field = field.child("half_extents");
    let before = violations.len();
    let half_extents = finite(
        sizes_field,
        required(sizes_field, sent.half_extents, violations)?,
        violations,
    );
    if violations.len() == before {
        for size in half_extents.to_array() {
            if check_size(sizes_field, size, half_extents, convention, violations) {
                break;
            }
        }
    }
    Some(OrientedBox {
        object_from_box: convention.pose_to_openxr(client_from_box),
        // The conversion permutes and mirrors axes; sizes have no sign.
        half_extents: convention.point_to_openxr(half_extents).abs(),
    })
}

/// A field of message type that must be present.
pub(super) fn required<T>(field: Field<'_>, sent: Option<T>, violations: &mut Violations) -> Option<T> {
    if sent.is_none() {
        violations.add(field, "is absent; it is required");
    }
    sent
}

/// Checks a size in the client's unit, which the error shows as `sent`. True if it is wrong.
fn check_size(
    field: Field<'_>,
    size: f32,
    sent: impl Display,
    convention: Convention,
    violations: &mut Violations,
) -> bool {
    let largest = convention.length_from_openxr(FARTHEST);
    let is_wrong = !(size > 0.0 && size <= largest);
    if is_wrong {
        violations.add(
            field,
            format_args!("is {sent}; every size must be more than 0 and at most {largest} (1 km)"),
        );
    }
    is_wrong
}

#[cfg(test)]
pub(crate) mod tests {
    use glam::{Quat, Vec3};
    use grasp_synthesis::base::pose::Pose;
    use proptest::prelude::{Just, Strategy, any, prop_oneof};

    use super::*;
    use crate::answer::{vector, wire_pose};

    const FIELD: Field<'static> = Field::root("obstacles");

    const CONVENTIONS: [Convention; 4] = [
        Convention::OpenXr,
        Convention::Unity,
        Convention::Unreal,
        Convention::Godot,
    ];

    /// Up to two obstacles as a client may send them, most of them valid.
    pub(crate) fn any_obstacles() -> impl Strategy<Value = Vec<v1::Obstacle>> {
        let size = || prop_oneof![200 => 0.001_f32..0.5, 1 => any::<f32>(), 1 => Just(0.0)];
        let place =
            || (-0.5_f32..0.5, -0.5_f32..0.5, -0.5_f32..0.5).prop_map(|(x, y, z)| v1::Vector3 { x, y, z });
        let solid = (place(), size(), size(), size()).prop_map(|(position, x, y, z)| {
            v1::obstacle::Shape::Box(v1::BoxShape {
                client_from_box: Some(v1::Pose {
                    position: Some(position),
                    orientation: None,
                }),
                half_extents: Some(v1::Vector3 { x, y, z }),
            })
        });
        let capsule = (place(), place(), size(), proptest::option::of(size())).prop_map(
            |(start, end, radius, end_radius)| {
                v1::obstacle::Shape::Capsule(v1::CapsuleShape {
                    client_start: Some(start),
                    client_end: Some(end),
                    radius,
                    end_radius,
                })
            },
        );
        let obstacle = prop_oneof![solid, capsule].prop_map(|shape| v1::Obstacle { shape: Some(shape) });
        proptest::collection::vec(obstacle, 0..3)
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
    fn boxes_and_capsules_keep_their_place_and_size_in_every_convention() {
        // A box as an engine describes it: a pose and half extents along the axes of the engine's frame.
        for convention in CONVENTIONS {
            let unit = if convention == Convention::Unreal {
                100.0
            } else {
                1.0
            };
            let OrientedBox {
                object_from_box: pose,
                half_extents,
            } = a_box();
            let (engine_pose, engine_sizes) = (
                Pose::new(pose.position * unit, pose.orientation),
                half_extents * unit,
            );
            let mut violations = Violations::default();
            let sent = [
                v1::Obstacle {
                    shape: Some(v1::obstacle::Shape::Box(v1::BoxShape {
                        client_from_box: Some(wire_pose(engine_pose)),
                        half_extents: Some(vector(engine_sizes)),
                    })),
                },
                v1::Obstacle {
                    shape: Some(v1::obstacle::Shape::Capsule(v1::CapsuleShape {
                        client_start: Some(vector(engine_pose.position)),
                        client_end: Some(vector(engine_sizes)),
                        radius: 0.05 * unit,
                        end_radius: Some(0.02 * unit),
                    })),
                },
            ];
            let read = obstacles(FIELD, &sent, Validity::Physical, convention, &mut violations);
            assert!(violations.is_empty(), "{convention:?} {violations:?}");
            let [Obstacle::Box(read_box), Obstacle::Capsule(read_capsule)] = read[..] else {
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
    fn a_capsule_without_an_end_radius_is_as_thick_at_its_end() {
        let sent = v1::CapsuleShape {
            client_start: Some(v1::Vector3::default()),
            client_end: Some(v1::Vector3::default()),
            radius: 0.04,
            end_radius: None,
        };
        let mut violations = Violations::default();
        let read = capsule(FIELD, &sent, Convention::OpenXr, &mut violations);
        assert_eq!(
            read,
            Some(TaperedCapsule::new(Vec3::ZERO, Vec3::ZERO, 0.04, 0.04))
        );
        assert!(violations.is_empty());
    }
}
