//! The same holdout in an engine's convention gets the same grasp in that convention.
//!
//! The conversions are written independently from the engines' tables, with matrices where the server uses quaternion
//! components.

use glam::{Mat3, Quat, Vec3};
use grasp_proto::v1::{self, presenting_hand::Form};
use grasp_tests::{TestServer, wire_pose};

use crate::fixtures::held_remote;

/// An engine's axes (columns: where `OpenXR`'s x, y and z go), its unit, and the turn of its hand joints.
struct Engine {
    convention: v1::Convention,
    axes: Mat3,
    units_per_metre: f32,
    joint_turn: Quat,
    wrist_place: usize,
}

fn engines() -> [Engine; 3] {
    let half_turn = Quat::from_axis_angle(
        Vec3::new(0.0, -1.0, 1.0).normalize_or(Vec3::Y),
        std::f32::consts::PI,
    );
    [
        Engine {
            convention: v1::Convention::Unity,
            axes: Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z),
            units_per_metre: 1.0,
            joint_turn: Quat::IDENTITY,
            wrist_place: 0,
        },
        Engine {
            convention: v1::Convention::Unreal,
            axes: Mat3::from_cols(Vec3::Y, Vec3::Z, Vec3::NEG_X),
            units_per_metre: 100.0,
            joint_turn: Quat::IDENTITY,
            wrist_place: 1,
        },
        Engine {
            convention: v1::Convention::Godot,
            axes: Mat3::IDENTITY,
            units_per_metre: 1.0,
            joint_turn: half_turn,
            wrist_place: 1,
        },
    ]
}

impl Engine {
    fn vector(&self, v: v1::Vector3, scale: f32) -> Vec3 {
        self.axes * Vec3::new(v.x, v.y, v.z) * scale
    }

    fn pose(&self, pose: &v1::Pose, turn: Quat) -> (Vec3, Mat3) {
        let q = pose.orientation.unwrap();
        let rotation = Mat3::from_quat(Quat::from_xyzw(q.x, q.y, q.z, q.w) * turn);
        (
            self.vector(pose.position.unwrap(), self.units_per_metre),
            self.axes * rotation * self.axes.transpose(),
        )
    }

    fn wire(&self, pose: &v1::Pose, turn: Quat) -> v1::Pose {
        let (position, rotation) = self.pose(pose, turn);
        wire_pose(grasp_synthesis::base::pose::Pose {
            position,
            orientation: Quat::from_mat3(&rotation).normalize(),
        })
    }

    fn request(&self, openxr: &v1::FindGraspRequest) -> v1::FindGraspRequest {
        let mut request = openxr.clone();
        request.convention = self.convention.into();
        request.client_from_object = openxr
            .client_from_object
            .as_ref()
            .map(|pose| self.wire(pose, Quat::IDENTITY));
        if let Some(Form::Angles(angles)) = &mut request.presenting_hand.as_mut().unwrap().form {
            let wrist = angles.client_from_wrist.as_ref().unwrap();
            angles.client_from_wrist = Some(self.wire(wrist, self.joint_turn));
        }
        request
    }

    fn assert_same_pose(&self, openxr: &v1::Pose, engine: &v1::Pose, turn: Quat) {
        let (position, rotation) = self.pose(openxr, turn);
        let p = engine.position.unwrap();
        let q = engine.orientation.unwrap();
        let distance = position.distance(Vec3::new(p.x, p.y, p.z)) / self.units_per_metre;
        assert!(distance < 1e-4, "{:?}: {distance} m apart", self.convention);
        let actual = Mat3::from_quat(Quat::from_xyzw(q.x, q.y, q.z, q.w));
        assert!(
            actual.abs_diff_eq(rotation, 1e-3),
            "{:?}: {actual} {rotation}",
            self.convention
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_holdout_gets_the_same_grasp_in_every_convention() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let request = v1::FindGraspRequest {
        reproducible: true,
        ..held_remote()
    };
    let answer = client.find_grasp(request.clone()).await.unwrap().into_inner();
    let attempts = answer.report.unwrap().attempts;
    let openxr = answer.grasp.expect("the holdout has a grasp");
    for engine in engines() {
        let answer = client
            .find_grasp(engine.request(&request))
            .await
            .unwrap()
            .into_inner();
        let grasp = answer.grasp.expect("the holdout has a grasp in every convention");
        assert_eq!(answer.report.unwrap().attempts, attempts);
        for (expected, actual) in openxr.digits.iter().zip(&grasp.digits) {
            assert!((expected.second_pitch - actual.second_pitch).abs() < 1e-4);
        }
        let turn = engine.joint_turn;
        for (expected, actual) in [
            (&openxr.client_from_wrist, &grasp.client_from_wrist),
            (&openxr.object_from_wrist, &grasp.object_from_wrist),
        ] {
            engine.assert_same_pose(expected.as_ref().unwrap(), actual.as_ref().unwrap(), turn);
        }
        assert_eq!(
            grasp.joints[engine.wrist_place].client_from_joint,
            grasp.client_from_wrist
        );
        for (place, expected) in openxr.joints.iter().enumerate() {
            // Unity lists the wrist (1) first and the palm (0) second.
            let place = if place < 2 && engine.wrist_place == 0 {
                1 - place
            } else {
                place
            };
            let actual = &grasp.joints[place];
            let pose = actual.client_from_joint.as_ref().unwrap();
            engine.assert_same_pose(expected.client_from_joint.as_ref().unwrap(), pose, turn);
            assert!((expected.radius * engine.units_per_metre - actual.radius).abs() < 1e-4);
        }
        assert_eq!(openxr.contacts.len(), grasp.contacts.len());
        for (expected, actual) in openxr.contacts.iter().zip(&grasp.contacts) {
            assert_eq!(expected.triangle, actual.triangle);
            for (expected, actual, scale) in [
                (
                    expected.client_position,
                    actual.client_position,
                    engine.units_per_metre,
                ),
                (
                    expected.object_position,
                    actual.object_position,
                    engine.units_per_metre,
                ),
                (expected.client_normal, actual.client_normal, 1.0),
                (expected.object_normal, actual.object_normal, 1.0),
                (expected.client_force, actual.client_force, 1.0),
                (expected.object_force, actual.object_force, 1.0),
            ] {
                let expected = engine.vector(expected.unwrap(), scale);
                let actual = actual.unwrap();
                let actual = Vec3::new(actual.x, actual.y, actual.z);
                assert!(
                    expected.distance(actual) < 2e-3 * scale,
                    "{:?}: {expected} {actual}",
                    engine.convention
                );
            }
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn gravity_defaults_to_the_conventions_up_axis() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    for (convention, [x, y, z]) in [
        (v1::Convention::Openxr, [0.0, 1.0, 0.0]),
        (v1::Convention::Unity, [0.0, 1.0, 0.0]),
        (v1::Convention::Unreal, [0.0, 0.0, 1.0]),
        (v1::Convention::Godot, [0.0, 1.0, 0.0]),
    ] {
        let implied = v1::FindGraspRequest {
            convention: convention.into(),
            reproducible: true,
            ..crate::fixtures::floating_remote()
        };
        let explicit = v1::FindGraspRequest {
            up: Some(v1::Vector3 {
                x: 3.0 * x,
                y: 3.0 * y,
                z: 3.0 * z,
            }),
            ..implied.clone()
        };
        let implied = client.find_grasp(implied).await.unwrap().into_inner();
        let explicit = client.find_grasp(explicit).await.unwrap().into_inner();
        assert!(implied.grasp.is_some());
        assert_eq!(implied.grasp, explicit.grasp, "{convention:?}");
    }
    server.stop().await;
}
