//! The same holdout in an engine's convention gets the same grasp in that convention.
//!
//! The conversions are written independently from the engines' tables, with matrices where the server uses quaternion
//! components.

use glam::{Mat3, Quat, Vec3};
use grasp_proto::v1::{self, presenting_hand::Form, shape::Kind};
use grasp_tests::TestServer;

use crate::fixtures::{find, hand as hand_of, held_remote, reproducible, vec3, with};

/// An engine's axes (columns: where `OpenXR`'s x, y and z go), its unit, and the turn of its hand joints.
pub(crate) struct Engine {
    convention: v1::Convention,
    axes: Mat3,
    /// Axes of meshes and of objects' frames.
    object_axes: Mat3,
    units_per_metre: f32,
    joint_turn: Quat,
    wrist_place: usize,
}

pub(crate) fn engines() -> [Engine; 5] {
    let unity = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z);
    let unreal = Mat3::from_cols(Vec3::Y, Vec3::Z, Vec3::NEG_X);
    let flipped = Mat3::from_cols(Vec3::NEG_X, Vec3::Y, Vec3::Z);
    let z_up = Mat3::from_cols(Vec3::X, Vec3::Z, Vec3::Y);
    let half_turn = Quat::from_axis_angle(
        Vec3::new(0.0, -1.0, 1.0).normalize_or(Vec3::Y),
        std::f32::consts::PI,
    );
    [
        (v1::Convention::Unity, unity, unity, 0),
        (v1::Convention::Unreal, unreal, unreal, 1),
        (v1::Convention::Godot, Mat3::IDENTITY, Mat3::IDENTITY, 1),
        (v1::Convention::UnityFlipX, unity, flipped, 0),
        (v1::Convention::UnrealXzy, unreal, z_up, 1),
    ]
    .map(|(convention, axes, object_axes, wrist_place)| Engine {
        convention,
        axes,
        object_axes,
        units_per_metre: if axes == unreal { 100.0 } else { 1.0 },
        joint_turn: if convention == v1::Convention::Godot {
            half_turn
        } else {
            Quat::IDENTITY
        },
        wrist_place,
    })
}

impl Engine {
    fn vector(&self, v: Vec3, scale: f32) -> Vec3 {
        self.axes * v * scale
    }

    /// A pose in a frame with some axes, of a frame with others.
    fn pose(&self, pose: v1::Pose, turn: Quat, [outer, inner]: [Mat3; 2]) -> (Vec3, Mat3) {
        let rotation = Mat3::from_quat(pose.orientation() * turn);
        (
            outer * pose.position() * self.units_per_metre,
            outer * rotation * inner.transpose(),
        )
    }

    fn wire(&self, pose: v1::Pose, turn: Quat) -> v1::Pose {
        self.wire_between(pose, turn, [self.axes, self.axes])
    }

    fn wire_between(&self, pose: v1::Pose, turn: Quat, axes: [Mat3; 2]) -> v1::Pose {
        let (position, rotation) = self.pose(pose, turn, axes);
        v1::Pose::new(position, Quat::from_mat3(&rotation).normalize())
    }

    /// A hand by its joint angles.
    fn hand(&self, hand: &mut v1::PresentingHand) {
        if let Some(Form::Pose(hand)) = &mut hand.form {
            let wrist = hand.client_from_wrist;
            hand.client_from_wrist = wrist.map(|pose| self.wire(pose, self.joint_turn));
        }
    }

    fn obstacle(&self, obstacle: &mut v1::Shape) {
        let point = |p: v1::Vector3| self.vector(p.into(), self.units_per_metre).into();
        match obstacle.kind.as_mut().unwrap() {
            Kind::Tube(tube) => {
                for end in &mut tube.points {
                    *end = point(*end);
                }
                for radius in &mut tube.radii {
                    *radius *= self.units_per_metre;
                }
            }
            Kind::Box(solid) => {
                solid.pose = solid.pose.map(|pose| self.wire(pose, Quat::IDENTITY));
                // Sizes follow the axes, without a sign.
                let half = self.vector(solid.half_extents(), self.units_per_metre);
                solid.half_extents = Some(half.abs().into());
            }
            Kind::HalfSpace(side) => {
                side.point = side.point.map(point);
                side.normal = side.normal.map(|normal| self.vector(normal.into(), 1.0).into());
            }
        }
    }

    /// A request of the `OpenXR` convention in the engine's.
    pub(crate) fn request(&self, openxr: &v1::FindGraspRequest) -> v1::FindGraspRequest {
        let mut request = openxr.clone().with_convention(self.convention);
        let holdout = request.holdout_mut();
        holdout.client_from_object = holdout
            .client_from_object
            .map(|pose| self.wire_between(pose, Quat::IDENTITY, [self.axes, self.object_axes]));
        for hand in holdout.presenting_hand.iter_mut().chain(&mut holdout.other_hands) {
            self.hand(hand);
        }
        for obstacle in &mut holdout.obstacles {
            self.obstacle(obstacle);
        }
        request
    }

    fn assert_same_pose(&self, openxr: Option<v1::Pose>, engine: Option<v1::Pose>, axes: [Mat3; 2]) {
        let [openxr, engine] = [openxr, engine].map(|pose| pose.expect("there is a pose"));
        let (position, rotation) = self.pose(openxr, self.joint_turn, axes);
        let distance = position.distance(engine.position()) / self.units_per_metre;
        assert!(distance < 1e-4, "{:?}: {distance} m apart", self.convention);
        let actual = Mat3::from_quat(engine.orientation());
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
            for (expected, actual, scale) in [
                (expected.position(), actual.position(), unit),
                (expected.normal(), actual.normal(), 1.0),
                (expected.force(), actual.force(), 1.0),
            ] {
                let expected = self.object_axes * expected * scale;
                assert!(
                    expected.distance(actual) < 2e-3 * scale,
                    "{:?}: {expected} {actual}",
                    self.convention
                );
            }
        }
    }

    /// Lengths among verdicts have the engine's unit, and other values are the same.
    fn assert_same_margins(&self, openxr: &v1::Grasp, grasp: &v1::Grasp) {
        assert_eq!(openxr.margins.len(), grasp.margins.len());
        for (expected, actual) in openxr.margins.iter().zip(&grasp.margins) {
            assert_eq!(expected.check, actual.check);
            let unit = match expected.check() {
                v1::Check::Balance | v1::Check::Closure => 1.0,
                _ => self.units_per_metre,
            };
            for (expected, actual) in [(expected.value, actual.value), (expected.bound, actual.bound)] {
                let [expected, actual] = [expected.map(|value| value * unit), actual];
                assert_eq!(expected.is_some(), actual.is_some());
                let difference = expected.unwrap_or_default() - actual.unwrap_or_default();
                assert!(
                    difference.abs() < 1e-3 * unit,
                    "{:?}: {expected:?} {actual:?}",
                    self.convention
                );
            }
        }
    }
}

/// The giver's other hand: the same hand, 10 cm farther along x.
fn hand_beyond_the_remote() -> v1::PresentingHand {
    let holdout = held_remote().holdout.expect("it has a holdout");
    let mut hand = holdout.presenting_hand.expect("it is held");
    if let Some(Form::Pose(hand)) = &mut hand.form {
        hand.handedness = v1::Handedness::Right.into();
        let wrist = hand.client_from_wrist.as_mut().unwrap();
        wrist.position.as_mut().unwrap().x += 0.1;
    }
    hand
}

/// A turned box of three different sizes, a capsule and a wall, near the remote on sides that leave room for a hand.
fn obstacles_around_the_remote() -> Vec<v1::Shape> {
    let turned = v1::Pose::new(
        Vec3::new(0.25, 1.3, -0.15),
        Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.4, -0.2),
    );
    vec![
        v1::Shape::solid_box(turned, Vec3::new(0.2, 0.06, 0.03)),
        v1::Shape::capsule(Vec3::new(0.1, 1.25, 0.05), Vec3::new(0.12, 1.5, 0.3), 0.03),
        v1::Shape::half_space(Vec3::new(-0.6, 1.0, 0.2), Vec3::new(-1.0, 0.1, 0.2)),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn a_holdout_gets_the_same_grasp_in_every_convention() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let request = with(reproducible(held_remote()), |request| {
        let holdout = request.holdout_mut();
        holdout.other_hands = vec![hand_beyond_the_remote()];
        holdout.obstacles = obstacles_around_the_remote();
    });
    let answer = find(&server, request.clone()).await;
    let attempts = answer.attempts();
    let openxr = answer.grasp().expect("the holdout has a grasp");
    let hand = hand_of(openxr);
    for engine in engines() {
        let answer = client
            .find_grasp(engine.request(&request))
            .await
            .unwrap()
            .into_inner();
        let grasp = answer
            .grasp()
            .expect("the holdout has a grasp in every convention");
        assert_eq!(answer.attempts(), attempts);
        let engines_hand = hand_of(grasp);
        assert_eq!(engines_hand.convention(), engine.convention);
        for (expected, actual) in hand.digits().into_iter().zip(engines_hand.digits()) {
            let [expected, actual] = [expected, actual].map(|digit| digit.expect("it has all"));
            assert!((expected.second_pitch - actual.second_pitch).abs() < 1e-4);
        }
        let in_client = [engine.axes, engine.axes];
        engine.assert_same_pose(hand.client_from_wrist, engines_hand.client_from_wrist, in_client);
        engine.assert_same_pose(
            hand.object_from_wrist,
            engines_hand.object_from_wrist,
            [engine.object_axes, engine.axes],
        );
        assert_eq!(
            engines_hand.joints[engine.wrist_place].pose,
            engines_hand.client_from_wrist
        );
        for (place, expected) in hand.joints.iter().enumerate() {
            // Unity lists the wrist (1) first and the palm (0) second.
            let place = if place < 2 && engine.wrist_place == 0 {
                1 - place
            } else {
                place
            };
            let actual = &engines_hand.joints[place];
            engine.assert_same_pose(expected.pose, actual.pose, in_client);
            assert!((expected.radius * engine.units_per_metre - actual.radius).abs() < 1e-4);
        }
        let [expected, actual] =
            [openxr, grasp].map(|grasp| grasp.arm.expect("the receiver faces the giver"));
        for (expected, actual) in [
            (expected.client_shoulder, actual.client_shoulder),
            (expected.client_elbow, actual.client_elbow),
        ] {
            let expected = engine.vector(vec3(expected), engine.units_per_metre);
            let distance = expected.distance(vec3(actual));
            assert!(
                distance < 2e-3 * engine.units_per_metre,
                "{:?}",
                engine.convention
            );
        }
        assert!((expected.wrist_flexion - actual.wrist_flexion).abs() < 1e-2);
        assert!((expected.wrist_deviation - actual.wrist_deviation).abs() < 1e-2);
        engine.assert_same_contacts(openxr, grasp);
        engine.assert_same_margins(openxr, grasp);
        // The hand is valid both as answered and given by its place in the client's frame.
        let by_client = v1::HandPose {
            object_from_wrist: None,
            ..engines_hand.clone()
        };
        for pose in [engines_hand.clone(), by_client] {
            let validation = v1::ValidateGraspRequest::from(engine.request(&request)).with_pose(pose);
            let answer = client.validate_grasp(validation).await.unwrap().into_inner();
            assert!(answer.valid, "{:?}: {:#?}", engine.convention, answer.verdicts);
            let seen = answer.grasp.expect("it is there");
            for check in [v1::Check::Penetration, v1::Check::GiverClearance] {
                let [was, is] = [grasp, &seen].map(|grasp| grasp.margin(check).expect("it was measured"));
                assert!(
                    (was - is).abs() <= 2e-5 * engine.units_per_metre,
                    "{check:?}: {was} {is}"
                );
            }
        }
    }
}
