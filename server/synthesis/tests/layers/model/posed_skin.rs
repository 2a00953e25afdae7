//! Skins follow the joints: rigidly, scaled, onto another hand, and without losing volume.

use glam::{Quat, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{DigitAngles, HandPose, Handedness, joints::HandJoints, rig::Rig, skin::Skin},
};

use crate::fixtures::hands::{all_hands, built_in_hand};

/// Volume within a closed mesh in cubic metres.
fn volume(positions: &[Vec3], triangles: &[[u32; 3]]) -> f32 {
    triangles
        .iter()
        .map(|&triangle| {
            let [a, b, c] = triangle.map(|v| positions[v as usize]);
            a.dot(b.cross(c)) / 6.0
        })
        .sum()
}

fn posed(skin: &Skin, rig: &Rig, digits: [DigitAngles; 5]) -> Vec<Vec3> {
    skin.posed(&HandJoints::of_pose(
        rig,
        &HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits,
        },
    ))
}

#[test]
fn the_bind_pose_leaves_a_skin_unchanged() {
    for hand in all_hands() {
        for (found, expected) in hand.skin.posed(&hand.skin.bind).iter().zip(&hand.skin.positions) {
            assert!(found.distance(*expected) < 1e-6, "{found} instead of {expected}");
        }
    }
}

#[test]
fn a_skin_moves_with_its_wrist() {
    let a_from_b = Pose::new(
        Vec3::new(0.4, -1.0, 2.0),
        Quat::from_xyzw(0.3, 0.1, -0.6, 0.7).normalize(),
    );
    for hand in all_hands() {
        let joints = HandJoints::of_pose(
            &hand.rig,
            &HandPose {
                frame_from_wrist: Pose::IDENTITY,
                digits: hand.rig.stretched(),
            },
        );
        let there = hand.skin.posed(&joints.transformed(a_from_b));
        for (here, there) in hand.skin.posed(&joints).iter().zip(there) {
            assert!(a_from_b.transform_point(*here).distance(there) < 5e-6);
        }
    }
}

#[test]
fn a_skin_scales_with_its_joints() {
    for hand in all_hands() {
        for scale in [0.8, 1.25] {
            let mut joints = hand.skin.bind.clone();
            for joint in &mut joints.joints {
                joint.pose.position *= scale;
                joint.radius *= scale;
            }
            for (found, bind) in hand.skin.posed(&joints).iter().zip(&hand.skin.positions) {
                assert!(
                    found.distance(scale * *bind) < 1e-5,
                    "{found} instead of {}",
                    scale * *bind
                );
            }
        }
    }
}

#[test]
fn a_skin_stretches_to_another_rigs_hand() {
    // On the joints of the thesis's larger hand, the adult's skin has that hand's volume.
    let (small, large) = (
        built_in_hand("adult", Handedness::Right),
        built_in_hand("thesis", Handedness::Right),
    );
    let on_large = small.skin.posed(&large.skin.bind);
    let ratio =
        volume(&on_large, &small.skin.triangles) / volume(&large.skin.positions, &large.skin.triangles);
    assert!((ratio - 1.0).abs() < 0.02, "the volumes' ratio is {ratio}");
}

#[test]
fn a_bent_skin_keeps_its_volume() {
    let bent = |degrees: [f32; 3]| {
        let [first, second, third] = degrees.map(f32::to_radians);
        DigitAngles {
            base_yaw: 0.0,
            base_pitch: first,
            second_pitch: second,
            third_pitch: third,
        }
    };
    for hand in all_hands() {
        let straight = volume(&hand.skin.positions, &hand.skin.triangles);
        for (name, fingers) in [
            ("flat", bent([0.0, 0.0, 0.0])),
            ("hook", bent([0.0, 90.0, 60.0])),
            ("fist", bent([85.0, 90.0, 60.0])),
        ] {
            let mut digits = [fingers; 5];
            digits[0] = bent([10.0, 20.0, 15.0]);
            let ratio = volume(&posed(&hand.skin, &hand.rig, digits), &hand.skin.triangles) / straight;
            println!("{} {name}: {ratio:.3} of the volume", hand.rig.name);
            assert!((0.93..1.07).contains(&ratio), "{name} has {ratio} of the volume");
        }
    }
}
