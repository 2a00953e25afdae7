//! Hands that are read, repaired and rejected.

use glam::{Quat, Vec3};
use grasp_assets::hands::{self, RIG_NAMES};
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        DigitAngles, HandPose, Handedness,
        joints::{HandJoints, JOINT_COUNT, index},
        rig::AngleRange,
    },
};
use proptest::{
    array::{uniform4, uniform5},
    prelude::*,
    test_runner::{Config, RngSeed},
};

use super::{
    JointedHand, MAX_MESH, meshed_hand,
    tracked::{AllowedGaps, tracked_hand},
};
use crate::{
    convention::Convention,
    validate::{
        Violations,
        fixtures::{
            CONVENTIONS, Change, JointSet, assert_blamed, joints_of_a_rig, read_at, sent, table,
            violations_of,
        },
    },
};

const HANDS: [Handedness; 2] = [Handedness::Left, Handedness::Right];
const SETS: [JointSet; 2] = [JointSet::OpenXr, JointSet::WebXr];

/// The hand, or the fields of its violations and their descriptions.
fn read(hand: &v1::HandJoints, convention: Convention) -> Result<JointedHand, Vec<(String, String)>> {
    let violations = Violations::default();
    let read = tracked_hand(violations.field("hand"), hand, convention, AllowedGaps::Nothing);
    assert_eq!(read.is_none(), !violations.is_empty());
    read.ok_or_else(|| violations_of(violations.finish(())))
}

fn blamed(hand: &v1::HandJoints, convention: Convention) -> Vec<String> {
    let violations = read(hand, convention).err().into_iter().flatten();
    violations.map(|(field, _)| field).collect()
}

/// The field of a joint, in the convention's order of 26 joints.
fn field_of(joint: usize, convention: Convention) -> String {
    format!("hand.joints[{}]", convention.joint_at(joint))
}

#[test]
fn reads_joints_in_every_convention_and_set() {
    for convention in CONVENTIONS {
        for (set, handedness) in SETS.into_iter().zip(HANDS) {
            let expected = joints_of_a_rig(handedness);
            let hand = read(&sent(&expected, convention, set), convention).unwrap();
            assert!(hand.warnings.is_empty(), "{:?}", hand.warnings);
            assert_eq!(hand.joints.handedness, handedness);
            for (joint, (read, expected)) in hand.joints.joints.iter().zip(&expected.joints).enumerate() {
                let (pose, same) = (read.pose, expected.pose);
                let is_same = pose.position.distance(same.position) < 1e-5
                    && pose.orientation.dot(same.orientation).abs() > 1.0 - 1e-5;
                // WebXR's set does not contain the palm's radius.
                let is_sent = joint != index::PALM || set == JointSet::OpenXr;
                let is_as_thick = !is_sent || (read.radius - expected.radius).abs() < 1e-6;
                assert!(
                    is_same && is_as_thick,
                    "{convention:?} {set:?} {joint}: {read:?} {expected:?}"
                );
            }
        }
    }
}

#[test]
fn names_joint_at_the_origin() {
    for convention in CONVENTIONS {
        for joint in 0..JOINT_COUNT {
            for turned in [false, true] {
                let mut hand = joints_of_a_rig(Handedness::Left);
                hand.joints[joint].pose.position = Vec3::ZERO;
                if turned {
                    hand.joints[joint].pose.orientation = Quat::IDENTITY;
                }
                let fields = blamed(&sent(&hand, convention, JointSet::OpenXr), convention);
                assert_eq!(fields, [field_of(joint, convention)], "{convention:?} {joint}");
            }
        }
    }
}

#[test]
fn names_every_joint_that_is_elsewhere() {
    for (lost, place) in [
        (vec![10, 15], Vec3::ZERO),
        (vec![1, 8], Vec3::ZERO),
        (vec![6, 7, 8, 9, 10], Vec3::ZERO),
        (vec![5, 10, 15, 20, 25], Vec3::ZERO),
        ((2..26).filter(|joint| joint % 2 == 0).collect(), Vec3::ZERO),
        (vec![12], Vec3::new(0.4, 1.5, -0.3)),
        (vec![9, 22], Vec3::new(-3.0, 1.0, 8.0)),
    ] {
        let mut hand = joints_of_a_rig(Handedness::Right);
        for &joint in &lost {
            hand.joints[joint].pose.position = place;
        }
        let sent = sent(&hand, Convention::OpenXr, JointSet::OpenXr);
        let fields = blamed(&sent, Convention::OpenXr);
        let expected = lost.iter().map(|&joint| field_of(joint, Convention::OpenXr));
        assert_eq!(fields, expected.collect::<Vec<_>>(), "{lost:?} at {place}");
    }
}

#[test]
fn names_joint_at_the_wrist_that_is_the_origin() {
    // Metacarpal joints may be there.
    let may_not = |joint: &usize| *joint != index::WRIST && !index::FIRST_OF_DIGIT.contains(joint);
    for joint in (0..JOINT_COUNT).filter(may_not) {
        let hand = joints_of_a_rig(Handedness::Right);
        let mut hand = hand.transformed(hand.joints[index::WRIST].pose.inverse());
        hand.joints[joint].pose.position = hand.joints[index::WRIST].pose.position;
        let sent = sent(&hand, Convention::OpenXr, JointSet::OpenXr);
        let fields = blamed(&sent, Convention::OpenXr);
        assert_eq!(fields, [format!("hand.joints[{joint}]")]);
    }
}

fn pose(hand: &mut v1::HandJoints) -> &mut v1::Pose {
    hand.joints[7].pose.as_mut().unwrap()
}

const OF_JOINTS: &[Change<v1::HandJoints>] = table! {
    "hand.handedness", "is required" => |hand| hand.handedness = 0;
    "hand.joints", "has 0 joints; it must have OpenXR's 26" => |hand| hand.joints.clear();
    "hand.joints", "has 24 joints" => |hand| hand.joints.truncate(24);
    "hand.joints", "has 27 joints" => |hand| hand.joints.extend_from_within(..1);
    "hand.joints[3].radius", "it must be 0 to 0.1" => |hand| hand.joints[3].radius = -0.001;
    "hand.joints[3].radius", "is NaN" => |hand| hand.joints[3].radius = f32::NAN;
    "hand.joints[3].radius", "is 1; it must be" => |hand| hand.joints[3].radius = 1.0;
    "hand.joints[24].pose", "is absent" => |hand| hand.joints[24].pose = None;
    "hand.joints[7].pose.orientation", "unit quaternion"
        => |hand| pose(hand).orientation = Some(v1::Quaternion::default());
    "hand.joints[7].pose.position", "must be finite" => |hand| pose(hand).position = Some(Vec3::NAN.into());
    "hand.joints", "at least 0.01 m" => |hand| {
        for joint in &mut hand.joints {
            joint.pose = Some(v1::Pose::default());
        }
    };
    "hand.joints[10]", "m from index-finger-phalanx-distal; in a hand of this size it can be at most 0.0"
        => |hand| hand.joints[10].pose = Some(v1::Pose::default());
};

#[test]
fn every_field_of_a_tracked_hand_is_checked() {
    let joints = joints_of_a_rig(Handedness::Left);
    let right = sent(&joints, Convention::OpenXr, JointSet::OpenXr);
    assert_blamed(&right, &[], OF_JOINTS, |hand| {
        read(&hand, Convention::OpenXr).unwrap_err()
    });
}

#[test]
fn names_joint_that_is_turned_around_or_lost_its_orientation() {
    let turned = Pose::new(Vec3::ZERO, Quat::from_rotation_x(1.0));
    let hand = joints_of_a_rig(Handedness::Left).transformed(turned);
    for (convention, joint) in CONVENTIONS
        .into_iter()
        .flat_map(|one| (0..JOINT_COUNT).map(move |j| (one, j)))
    {
        for axis in [None, Some(Vec3::X), Some(Vec3::Y), Some(Vec3::Z)] {
            let mut turned = hand.clone();
            if let Some(axis) = axis {
                turned.joints[joint].pose.orientation *= Quat::from_axis_angle(axis, std::f32::consts::PI);
            }
            let mut sent = sent(&turned, convention, JointSet::OpenXr);
            if axis.is_none() {
                let place = convention.joint_at(joint);
                sent.joints[place].pose.as_mut().unwrap().orientation = None;
            }
            let blamed = blamed(&sent, convention);
            // The thumb's roll differs between headsets.
            let is_thumbs_roll = axis == Some(Vec3::Z) && (2..6).contains(&joint);
            let expected = (!is_thumbs_roll).then(|| field_of(joint, convention));
            assert_eq!(blamed, expected.as_slice(), "{convention:?} {joint} {axis:?}");
        }
    }
}

#[test]
fn names_handedness_of_the_other_hand() {
    for convention in CONVENTIONS {
        for (set, handedness) in SETS.into_iter().zip(HANDS) {
            let mut hand = joints_of_a_rig(handedness);
            hand.handedness = handedness.other();
            let blamed = blamed(&sent(&hand, convention, set), convention);
            assert_eq!(blamed, ["hand.handedness"]);
        }
    }
}

#[test]
fn names_convention_of_another_engine() {
    let hand = joints_of_a_rig(Handedness::Right);
    for (actual, claimed) in [
        (Convention::Unity, Convention::OpenXr),
        (Convention::OpenXr, Convention::Unity),
        (Convention::Godot, Convention::OpenXr),
        (Convention::OpenXr, Convention::Godot),
        (Convention::Unity, Convention::Godot),
    ] {
        let violations = read(&sent(&hand, actual, JointSet::WebXr), claimed).unwrap_err();
        assert_eq!(violations[0].0, "output.convention", "{actual:?} as {claimed:?}");
    }
}

#[test]
fn replaces_missing_radii_with_a_warning() {
    let hand = joints_of_a_rig(Handedness::Left);
    for convention in CONVENTIONS {
        let mut sent = sent(&hand, convention, JointSet::OpenXr);
        for joint in &mut sent.joints {
            joint.radius = 0.0;
        }
        let read = read(&sent, convention).unwrap();
        for (read, whole) in read.joints.joints.iter().zip(&hand.joints) {
            assert!((read.radius / whole.radius - 1.0).abs() < 1e-3);
        }
        assert_eq!(read.warnings.len(), 1);
        let unit = convention.length_from_openxr(1.0);
        let first = hand.joints[convention.joint_at(0)].radius * unit;
        let text = format!(
            "hand.joints: 26 radii are 0 and were replaced by the adult rig's, scaled to the \
                            neighbouring joints or the hand: [0] {first:.4} [1] "
        );
        assert!(read.warnings[0].starts_with(&text), "{:?}", read.warnings);
    }
}

fn tetrahedron() -> v1::HandMesh {
    v1::HandMesh {
        client_coordinates: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        triangles: vec![0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2],
        client_from_wrist: Some(v1::Pose::default()),
    }
}

#[test]
fn converts_vertices_and_wrist_of_a_mesh_from_the_convention() {
    let (read, _) = read_at("hand", |field| {
        meshed_hand(field, &tetrahedron(), Convention::Unreal)
    });
    let read = read.expect("it is sound");
    let expected = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|p| Convention::Unreal.point_to_openxr(p));
    assert_eq!(read.positions, expected);
    assert!((read.positions[1].length() - 0.01).abs() < 1e-6);
    assert!(read.client_from_wrist.is_some());
}

const OF_MESHES: &[Change<v1::HandMesh>] = table! {
    "hand.client_coordinates", "the first is vertex 1, [1, NaN, 0]" => |mesh| mesh.client_coordinates[4] = f32::NAN;
    "hand.client_coordinates", "has 1 vertices" => |mesh| mesh.client_coordinates[11] = 1001.0;
    "hand.triangles", "the first is triangle 0, (0, 2, 4)" => |mesh| mesh.triangles[2] = 4;
    "hand.client_from_wrist.orientation", "unit quaternion"
        => |mesh| mesh.client_from_wrist.as_mut().unwrap().orientation = Some(v1::Quaternion::default());
    "hand.triangles", "multiple of 3" => |mesh| mesh.triangles.clear();
    "hand.triangles", "multiple of 3" => |mesh| mesh.triangles.push(0);
    "hand.triangles", "multiple of 3" => |mesh| mesh.triangles = vec![0; 3 * MAX_MESH + 3];
};

#[test]
fn every_field_of_a_mesh_is_checked() {
    let blamed = |mesh: v1::HandMesh| {
        let violations = Violations::default();
        assert!(meshed_hand(violations.field("hand"), &mesh, Convention::OpenXr).is_none());
        violations_of(violations.finish(()))
    };
    assert_blamed(&tetrahedron(), &[], OF_MESHES, blamed);
    let mut mesh = tetrahedron();
    mesh.client_coordinates.push(0.0);
    assert!(blamed(mesh)[0].1.contains("multiple of 3"));
}

proptest! {
    #![proptest_config(Config {
        cases: 300,
        rng_seed: RngSeed::Fixed(7),
        failure_persistence: None,
        ..Config::default()
    })]

    #[test]
    fn accepts_every_pose_of_every_rig_and_size(
        shares in uniform5(uniform4(0.0_f32..1.0)),
        (axis, angle) in ([-1.0_f32..1.0, -1.0..1.0, -1.0..1.0], 0.0_f32..6.3),
        size in 0.4_f32..2.2,
        at_wrist: bool,
    ) {
        let turn = Quat::from_axis_angle(Vec3::from(axis).normalize_or(Vec3::X), angle);
        for (rig, handedness) in RIG_NAMES.into_iter().flat_map(|rig| HANDS.map(|hand| (rig, hand))) {
            let rig = &hands::hand(rig, handedness).unwrap().rig;
            let within = |range: AngleRange, share: f32| range.min + share * (range.max - range.min);
            let digits = std::array::from_fn(|digit| {
                let (limits, shares) = (&rig.digits[digit].limits, shares[digit]);
                DigitAngles {
                    base_yaw: within(limits.base_yaw, shares[0]),
                    base_pitch: within(limits.base_pitch, shares[1]),
                    second_pitch: within(limits.second_pitch, shares[2]),
                    third_pitch: within(limits.third_pitch, shares[3]),
                }
            });
            let frame_from_wrist = if at_wrist {
                Pose::IDENTITY
            } else {
                Pose::new(Vec3::new(0.2, 0.9, -0.4), turn)
            };
            let mut hand = HandJoints::of_pose(rig, &HandPose { frame_from_wrist, digits });
            for joint in &mut hand.joints {
                joint.pose.position *= size;
            }
            for (convention, set) in CONVENTIONS.into_iter().flat_map(|one| SETS.map(|set| (one, set))) {
                let read = read(&sent(&hand, convention, set), convention);
                prop_assert!(read.is_ok(), "{:?}", read.unwrap_err());
            }
        }
    }
}
