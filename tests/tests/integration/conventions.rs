//! The same holdout in an engine's convention gets the same grasp in that convention.
//!
//! The conversions are written independently from the engines' tables, with matrices where the server uses quaternion
//! components.

use glam::{Mat3, Quat, Vec3};
use grasp_proto::v1::{self, obstacle::Shape, presenting_hand::Form};
use grasp_tests::{TestServer, wire_pose};

use crate::fixtures::held_remote;

/// An engine's axes (columns: where `OpenXR`'s x, y and z go), its unit, and the turn of its hand joints.
pub(crate) struct Engine {
    convention: v1::Convention,
    axes: Mat3,
    /// The same for meshes and frames of objects.
    object_axes: Mat3,
    units_per_metre: f32,
    joint_turn: Quat,
    wrist_place: usize,
}

pub(crate) fn engines() -> [Engine; 5] {
    let half_turn = Quat::from_axis_angle(
        Vec3::new(0.0, -1.0, 1.0).normalize_or(Vec3::Y),
        std::f32::consts::PI,
    );
    let unity = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z);
    let unreal = Mat3::from_cols(Vec3::Y, Vec3::Z, Vec3::NEG_X);
    [
        Engine {
            convention: v1::Convention::Unity,
            axes: unity,
            object_axes: unity,
            units_per_metre: 1.0,
            joint_turn: Quat::IDENTITY,
            wrist_place: 0,
        },
        Engine {
            convention: v1::Convention::Unreal,
            axes: unreal,
            object_axes: unreal,
            units_per_metre: 100.0,
            joint_turn: Quat::IDENTITY,
            wrist_place: 1,
        },
        Engine {
            convention: v1::Convention::Godot,
            axes: Mat3::IDENTITY,
            object_axes: Mat3::IDENTITY,
            units_per_metre: 1.0,
            joint_turn: half_turn,
            wrist_place: 1,
        },
        Engine {
            convention: v1::Convention::UnityFlipX,
            axes: unity,
            object_axes: Mat3::from_cols(Vec3::NEG_X, Vec3::Y, Vec3::Z),
            units_per_metre: 1.0,
            joint_turn: Quat::IDENTITY,
            wrist_place: 0,
        },
        Engine {
            convention: v1::Convention::UnrealXzy,
            axes: unreal,
            object_axes: Mat3::from_cols(Vec3::X, Vec3::Z, Vec3::Y),
            units_per_metre: 100.0,
            joint_turn: Quat::IDENTITY,
            wrist_place: 1,
        },
    ]
}

impl Engine {
    fn vector(&self, v: v1::Vector3, scale: f32) -> Vec3 {
        self.axes * Vec3::new(v.x, v.y, v.z) * scale
    }

    /// A pose in a frame with some axes, of a frame with others.
    fn pose(&self, pose: &v1::Pose, turn: Quat, [outer, inner]: [Mat3; 2]) -> (Vec3, Mat3) {
        let q = pose.orientation.unwrap();
        let rotation = Mat3::from_quat(Quat::from_xyzw(q.x, q.y, q.z, q.w) * turn);
        let p = pose.position.unwrap();
        (
            outer * Vec3::new(p.x, p.y, p.z) * self.units_per_metre,
            outer * rotation * inner.transpose(),
        )
    }

    fn wire(&self, pose: &v1::Pose, turn: Quat) -> v1::Pose {
        self.wire_between(pose, turn, [self.axes, self.axes])
    }

    fn wire_between(&self, pose: &v1::Pose, turn: Quat, axes: [Mat3; 2]) -> v1::Pose {
        let (position, rotation) = self.pose(pose, turn, axes);
        wire_pose(grasp_synthesis::base::pose::Pose {
            position,
            orientation: Quat::from_mat3(&rotation).normalize(),
        })
    }

    /// A hand by its joint angles, or by the 26 joints of `OpenXR`.
    fn hand(&self, hand: &mut v1::PresentingHand) {
        match &mut hand.form {
            Some(Form::Angles(angles)) => {
                let wrist = angles.client_from_wrist.as_ref().unwrap();
                angles.client_from_wrist = Some(self.wire(wrist, self.joint_turn));
            }
            Some(Form::Joints(hand)) => {
                for joint in &mut hand.joints {
                    let pose = joint.client_from_joint.as_ref().unwrap();
                    joint.client_from_joint = Some(self.wire(pose, self.joint_turn));
                    joint.radius *= self.units_per_metre;
                }
                // `OpenXR` lists the palm first and the wrist second.
                hand.joints.swap(1, self.wrist_place);
            }
            _ => {}
        }
    }

    fn obstacle(&self, obstacle: &mut v1::Obstacle) {
        let wire = |v: Vec3| {
            Some(v1::Vector3 {
                x: v.x,
                y: v.y,
                z: v.z,
            })
        };
        let point = |p: Option<v1::Vector3>| wire(self.vector(p.unwrap(), self.units_per_metre));
        match obstacle.shape.as_mut().unwrap() {
            Shape::Capsule(capsule) => {
                capsule.client_start = point(capsule.client_start);
                capsule.client_end = point(capsule.client_end);
                capsule.radius *= self.units_per_metre;
            }
            Shape::Box(solid) => {
                solid.client_from_box = solid
                    .client_from_box
                    .as_ref()
                    .map(|pose| self.wire(pose, Quat::IDENTITY));
                // Sizes follow the axes, without a sign.
                let half = self.vector(solid.half_extents.unwrap(), self.units_per_metre);
                solid.half_extents = wire(half.abs());
            }
        }
    }

    /// A request of the `OpenXR` convention in the engine's.
    pub(crate) fn request(&self, openxr: &v1::FindGraspRequest) -> v1::FindGraspRequest {
        let mut request = openxr.clone();
        request.convention = self.convention.into();
        request.client_from_object = openxr
            .client_from_object
            .as_ref()
            .map(|pose| self.wire_between(pose, Quat::IDENTITY, [self.axes, self.object_axes]));
        for hand in request.presenting_hand.iter_mut().chain(&mut request.other_hands) {
            self.hand(hand);
        }
        for obstacle in &mut request.obstacles {
            self.obstacle(obstacle);
        }
        request
    }

    fn assert_same_pose(&self, openxr: &v1::Pose, engine: &v1::Pose, axes: [Mat3; 2]) {
        let (position, rotation) = self.pose(openxr, self.joint_turn, axes);
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

    fn assert_same_contacts(&self, openxr: &v1::Grasp, grasp: &v1::Grasp) {
        assert_eq!(openxr.contacts.len(), grasp.contacts.len());
        for (expected, actual) in openxr.contacts.iter().zip(&grasp.contacts) {
            assert_eq!(expected.triangle, actual.triangle);
            let unit = self.units_per_metre;
            for (expected, actual, axes, scale) in [
                (expected.client_position, actual.client_position, self.axes, unit),
                (
                    expected.object_position,
                    actual.object_position,
                    self.object_axes,
                    unit,
                ),
                (expected.client_normal, actual.client_normal, self.axes, 1.0),
                (
                    expected.object_normal,
                    actual.object_normal,
                    self.object_axes,
                    1.0,
                ),
                (expected.client_force, actual.client_force, self.axes, 1.0),
                (expected.object_force, actual.object_force, self.object_axes, 1.0),
            ] {
                let expected = expected.unwrap();
                let expected = axes * Vec3::new(expected.x, expected.y, expected.z) * scale;
                let actual = actual.unwrap();
                let actual = Vec3::new(actual.x, actual.y, actual.z);
                assert!(
                    expected.distance(actual) < 2e-3 * scale,
                    "{:?}: {expected} {actual}",
                    self.convention
                );
            }
        }
    }
}

/// The giver's other hand: the same hand, 10 cm farther along x.
fn hand_beyond_the_remote() -> v1::PresentingHand {
    let mut hand = held_remote().presenting_hand.expect("it is held");
    if let Some(Form::Angles(angles)) = &mut hand.form {
        angles.handedness = v1::Handedness::Right.into();
        let wrist = angles.client_from_wrist.as_mut().unwrap();
        wrist.position.as_mut().unwrap().x += 0.1;
    }
    hand
}

/// A turned box of three different sizes and a capsule, near the remote on sides that leave room for a hand.
fn obstacles_around_the_remote() -> Vec<v1::Obstacle> {
    let vector = |x: f32, y: f32, z: f32| Some(v1::Vector3 { x, y, z });
    let shapes = [
        Shape::Box(v1::BoxShape {
            client_from_box: Some(wire_pose(grasp_synthesis::base::pose::Pose {
                position: Vec3::new(0.25, 1.3, -0.15),
                orientation: Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.4, -0.2),
            })),
            half_extents: vector(0.2, 0.06, 0.03),
        }),
        Shape::Capsule(v1::CapsuleShape {
            client_start: vector(0.1, 1.25, 0.05),
            client_end: vector(0.12, 1.5, 0.3),
            radius: 0.03,
            end_radius: None,
        }),
    ];
    shapes.map(|shape| v1::Obstacle { shape: Some(shape) }).to_vec()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_holdout_gets_the_same_grasp_in_every_convention() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let request = v1::FindGraspRequest {
        reproducible: true,
        other_hands: vec![hand_beyond_the_remote()],
        obstacles: obstacles_around_the_remote(),
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
        let in_client = [engine.axes, engine.axes];
        for (expected, actual, axes) in [
            (&openxr.client_from_wrist, &grasp.client_from_wrist, in_client),
            (
                &openxr.object_from_wrist,
                &grasp.object_from_wrist,
                [engine.object_axes, engine.axes],
            ),
        ] {
            engine.assert_same_pose(expected.as_ref().unwrap(), actual.as_ref().unwrap(), axes);
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
            engine.assert_same_pose(expected.client_from_joint.as_ref().unwrap(), pose, in_client);
            assert!((expected.radius * engine.units_per_metre - actual.radius).abs() < 1e-4);
        }
        let [expected, actual] =
            [&openxr, &grasp].map(|grasp| grasp.arm.expect("the receiver faces the giver"));
        assert!(expected.assumed && actual.assumed);
        for (expected, actual) in [
            (expected.client_shoulder, actual.client_shoulder),
            (expected.client_elbow, actual.client_elbow),
        ] {
            let expected = engine.vector(expected.unwrap(), engine.units_per_metre);
            let actual = actual.unwrap();
            let distance = expected.distance(Vec3::new(actual.x, actual.y, actual.z));
            assert!(
                distance < 2e-3 * engine.units_per_metre,
                "{:?}",
                engine.convention
            );
        }
        assert!((expected.wrist_flexion - actual.wrist_flexion).abs() < 1e-2);
        assert!((expected.wrist_deviation - actual.wrist_deviation).abs() < 1e-2);
        engine.assert_same_contacts(&openxr, &grasp);
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
