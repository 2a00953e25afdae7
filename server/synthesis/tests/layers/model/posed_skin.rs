//! Skins follow the joints: rigidly, scaled, onto another hand, and without losing volume.

use grasp_synthesis::model::hand::skin::Skin;

use crate::prelude::*;

/// Volume within a skin in cubic metres.
fn volume(skin: &Skin, positions: Vec<Vec3>) -> f64 {
    let mesh = TriangleMesh::without_degenerates(positions, &skin.triangles);
    mesh.expect("a skin is a mesh").signed_volume()
}

#[test]
fn a_skin_moves_and_scales_with_its_joints() {
    let turn = Quat::from_xyzw(0.3, 0.1, -0.6, 0.7).normalize();
    let moved = Pose::new(Vec3::new(0.4, -1.0, 2.0), turn);
    for hand in all_hands() {
        for (a_from_b, scale, rounding) in [
            (Pose::IDENTITY, 1.0, 1e-6),
            (moved, 1.0, 5e-6),
            (Pose::IDENTITY, 0.8, 1e-5),
            (Pose::IDENTITY, 1.25, 1e-5),
        ] {
            let mut joints = hand.skin.bind.clone();
            for joint in &mut joints.joints {
                joint.pose.position *= scale;
                joint.radius *= scale;
            }
            let posed = hand.skin.posed(&joints.transformed(a_from_b));
            for (found, bind) in posed.iter().zip(&hand.skin.positions) {
                let expected = a_from_b.transform_point(scale * *bind);
                assert!(found.distance(expected) < rounding, "{found} {expected}");
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
    let on_large = volume(&small.skin, small.skin.posed(&large.skin.bind));
    let ratio = on_large / volume(&large.skin, large.skin.positions.clone());
    assert!((ratio - 1.0).abs() < 0.02, "the volumes' ratio is {ratio}");
}

#[test]
fn a_bent_skin_keeps_its_volume() {
    let bent = |degrees: [f32; 3]| {
        let [first, second, third] = degrees.map(f32::to_radians);
        angles([0.0, first, second, third])
    };
    for hand in all_hands() {
        let straight = volume(&hand.skin, hand.skin.positions.clone());
        for (name, fingers) in [
            ("flat", bent([0.0, 0.0, 0.0])),
            ("hook", bent([0.0, 90.0, 60.0])),
            ("fist", bent([85.0, 90.0, 60.0])),
        ] {
            let mut digits = [fingers; 5];
            digits[0] = bent([10.0, 20.0, 15.0]);
            let joints = HandJoints::of_pose(&hand.rig, &hand_pose(Pose::IDENTITY, digits));
            let ratio = volume(&hand.skin, hand.skin.posed(&joints)) / straight;
            assert!((0.93..1.07).contains(&ratio), "{name} has {ratio} of the volume");
        }
    }
}
