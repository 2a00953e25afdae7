//! Objects, presenting hands and holdouts: what they accept and what they reject.

use grasp_synthesis::{
    geometry::mesh::MeshError,
    model::{
        hand::joints::Skin,
        holdout::PresentingHandError,
        plain_object::{MAX_NAMED_TRIANGLES, ObjectError},
    },
};

use crate::prelude::*;

/// Joints in a row along x.
fn joints() -> HandJoints {
    HandJoints {
        handedness: Handedness::Right,
        joints: std::array::from_fn(|i| Joint {
            pose: Pose::from_position(Vec3::X * 0.01 * i as f32),
            radius: 0.008,
        }),
    }
}

/// A sphere that follows the wrist.
fn skin() -> Skin {
    let sphere = sphere(0.04, 8);
    let count = sphere.positions().len();
    Skin {
        positions: sphere.positions().to_vec(),
        triangles: sphere.triangles().to_vec(),
        joint_indices: vec![[index::WRIST as u8, 0, 0, 0]; count],
        weights: vec![[1.0, 0.0, 0.0, 0.0]; count],
        bind: joints(),
    }
}

#[test]
fn presenting_hand_skin_follows_its_joints() {
    let mut random = Random::new(12);
    let object_from_frame = Pose::new(random.in_cube(), random.rotation());
    let hand = PresentingHand::in_frame(&skin(), &joints(), object_from_frame).expect("the hand is sound");
    let posed = hand.surface().expect("it has a skin");
    let surface = posed.mesh();
    assert_eq!(surface.triangles(), skin().triangles);
    for (posed, bound) in surface.positions().iter().zip(skin().positions) {
        assert!(posed.distance(object_from_frame.transform_point(bound)) < 1e-6);
    }
    let palm = object_from_frame.transform_point(Vec3::new(0.0, -0.008, 0.0));
    assert!(hand.palm.distance(palm) < 1e-6, "{} {palm}", hand.palm);
    assert!(posed.contains(object_from_frame.transform_point(Vec3::new(0.01, -0.02, 0.03))));
}

#[test]
fn collapsed_triangles_of_a_skin_are_dropped() {
    let mut skin = skin();
    let [a, b, _] = skin.triangles[20];
    skin.positions[a as usize] = skin.positions[b as usize];
    let hand = PresentingHand::in_frame(&skin, &joints(), Pose::IDENTITY).expect("the hand is sound");
    let posed = hand.surface().expect("it has a skin");
    // The two triangles at the edge collapse.
    assert_eq!(posed.mesh().triangles().len(), skin.triangles.len() - 2);
    assert!(posed.contains(Vec3::new(0.01, -0.02, 0.03)));
}

#[test]
fn rejects_unsound_presenting_hands() {
    let mut collapsed = skin();
    collapsed.positions.fill(Vec3::ZERO);
    let rejection = |skin: &Skin, joints: HandJoints| {
        PresentingHand::in_frame(skin, &joints, Pose::IDENTITY).expect_err("it is unsound")
    };
    assert_eq!(rejection(&collapsed, joints()), PresentingHandError::Collapsed);

    let mut far = joints();
    far.joints[index::WRIST].pose.position = Vec3::splat(f32::INFINITY);
    let not_finite = PresentingHandError::NotFinite { vertex: 0 };
    assert_eq!(rejection(&skin(), far), not_finite);

    let mut broken = skin();
    broken.triangles[3][1] = 9_999;
    let vertices = broken.positions.len();
    assert_eq!(
        rejection(&broken, joints()),
        PresentingHandError::Skin(MeshError::IndexOutOfRange {
            triangle: 3,
            vertex: 9_999,
            vertices
        })
    );
}

#[test]
fn objects_report_every_violation_up_to_a_limit() {
    let mesh = || cuboid(Vec3::splat(0.05), 1);
    let errors = GraspObject::new(mesh(), f32::NAN, Vec3::INFINITY, Some(-1.0), &[3, 12])
        .expect_err("everything is wrong");
    assert!(matches!(
        errors[..],
        [
            ObjectError::Mass(_),
            ObjectError::Friction(_),
            ObjectError::CentreOfMass(_),
            ObjectError::ForbiddenTriangle {
                triangle: 12,
                triangles: 12
            }
        ]
    ));
    let unknown: Vec<u32> = (100..100_000).collect();
    let errors =
        GraspObject::new(mesh(), 1.0, Vec3::ZERO, Some(0.3), &unknown).expect_err("they do not exist");
    assert_eq!(errors.len(), MAX_NAMED_TRIANGLES + 1);
    assert_eq!(
        errors.last(),
        Some(&ObjectError::MoreForbiddenTriangles {
            count: unknown.len() - MAX_NAMED_TRIANGLES,
            triangles: 12
        })
    );

    let object = GraspObject::new(mesh(), 0.2, Vec3::ZERO, Some(0.3), &[3, 3, 5]).expect("it is sound");
    assert_eq!(object.forbidden_count(), 2);
    assert!(object.is_forbidden(3) && object.is_forbidden(5) && !object.is_forbidden(4));
}

#[test]
fn rejects_up_that_is_not_a_unit_vector() {
    let object = Arc::new(bar());
    assert!(Holdout::new(Arc::clone(&object), None, Vec3::Y).is_some());
    for up in [Vec3::ZERO, Vec3::Y * 2.0, Vec3::NAN] {
        assert!(Holdout::new(Arc::clone(&object), None, up).is_none(), "{up}");
    }
}
