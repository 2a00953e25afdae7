//! What is written is read, and what version 0.1 wrote.

use glam::Vec3;

use super::*;

fn read(fields: &Fields) -> v1::GraspObject {
    let bytes = fields.encode_to_vec();
    Fields::decode(bytes.as_slice()).expect("they are fields").into()
}

#[test]
fn what_a_client_gave_is_read_as_it_was_written() {
    let vector = |x: f32| v1::Vector3::from(Vec3::new(x, 1.0, -2.0));
    let pose = v1::Pose {
        position: None,
        orientation: Some(glam::Quat::from_rotation_x(1.0).into()),
    };
    let digit = |angle: f32| v1::DigitAngles {
        base_yaw: angle,
        third_pitch: (angle > 1.0).then_some(angle),
        ..Default::default()
    };
    let hand = v1::HandPose {
        scale: Some(0.9),
        object_from_wrist: Some(pose),
        convention: v1::Convention::UnrealXzy.into(),
        ..v1::HandPose::new("rigs/mine", v1::Handedness::Left)
    };
    let hand = hand.with_digits([Some(digit(0.0)), None, Some(digit(2.0)), None, Some(digit(0.5))]);
    let object = v1::GraspObject {
        name: "objects/mug".to_owned(),
        labels: [("level".to_owned(), "kitchen".to_owned())].into(),
        mass_kg: 0.3,
        center_of_mass: Some(vector(0.5)),
        friction: Some(0.0),
        regions: vec![
            v1::Region {
                weight: Some(0.5),
                shapes: vec![
                    v1::Shape {
                        kind: Some(Kind::Tube(v1::TubeShape {
                            points: vec![vector(0.0), vector(1.0)],
                            radii: vec![0.1, 0.2],
                        })),
                    },
                    v1::Shape::ball(Vec3::ZERO, 0.1),
                    v1::Shape::solid_box(pose, Vec3::ONE),
                    v1::Shape::half_space(Vec3::X, Vec3::Y),
                ],
                ..v1::Region::new("all", v1::Preference::Avoided)
            },
            v1::Region {
                groups: vec!["rim".to_owned()],
                triangles: vec![3, 4],
                ..v1::Region::new("rim", v1::Preference::Forbidden)
            },
        ],
        known_grips: vec![
            v1::KnownGrip::new("mine", v1::Preference::Preferred, hand.clone()),
            v1::KnownGrip {
                near_distance: Some(0.1),
                near_angle: Some(0.2),
                ..v1::KnownGrip::new(
                    "not",
                    v1::Preference::Forbidden,
                    v1::HandPose {
                        rig: String::new(),
                        ..hand
                    },
                )
            },
        ],
        meters_per_unit: Some(0.01),
        z_up: true,
        parts: vec!["body".to_owned()],
        ..Default::default()
    };
    assert_eq!(read(&object.clone().into()), object);
    let plain = v1::GraspObject {
        name: "objects/mug".to_owned(),
        ..Default::default()
    };
    assert_eq!(read(&plain.clone().into()), plain);
}

#[test]
fn a_list_of_forbidden_surfaces_becomes_a_region_of_a_free_name() {
    let named = |name: &str| Region::from(v1::Region::new(name, v1::Preference::Preferred));
    let fields = Fields {
        forbidden: Some(Forbidden {
            groups: vec!["rim".to_owned()],
            triangles: vec![7],
        }),
        regions: vec![named("forbidden"), named("forbidden 2")],
        ..Default::default()
    };
    let regions = read(&fields).regions;
    let region = v1::Region {
        groups: vec!["rim".to_owned()],
        triangles: vec![7],
        ..v1::Region::new("forbidden 3", v1::Preference::Forbidden)
    };
    assert_eq!((regions.len(), &regions[2]), (3, &region));
    let none = Fields {
        forbidden: Some(Forbidden::default()),
        ..Default::default()
    };
    assert!(read(&none).regions.is_empty());
}

#[test]
fn grips_of_version_0_1_have_their_digits_in_a_list_and_bare_names_of_rigs() {
    let fields = Fields {
        known_grips: vec![Grip {
            rig: "adult".to_owned(),
            used: 1,
            side: v1::Handedness::Right.into(),
            digits: vec![v1::DigitAngles::default(); 5],
            ..Default::default()
        }],
        ..Default::default()
    };
    let hand = read(&fields).known_grips.remove(0).hand.expect("it has one");
    assert_eq!(hand.rig, "rigs/adult");
    assert!(hand.digits().iter().all(Option::is_some));
    assert_eq!(hand.object_from_wrist, Some(v1::Pose::default()));
    assert_eq!(hand.convention(), v1::Convention::Openxr);
}
