//! A saved answer is a known grip, a current grasp and a grasp to validate as it is, whatever the convention of the request that it
//! comes back in.

use glam::{Quat, Vec3};
use grasp_proto::v1::{self, CurrentGraspStatus};
use grasp_tests::TestServer;

use crate::{
    conventions::engines,
    fixtures::{box_request, held_remote, receiving},
    parts::{hand, masked, update_of, with, with_object},
    validate_grasp::{metre, request, validated},
};

/// How far wrists and angles may be from the saved ones, in metres and radians.
const ROUNDING: f32 = 1e-5;

const CONVENTIONS: [v1::Convention; 4] = [
    v1::Convention::Openxr,
    v1::Convention::Unity,
    v1::Convention::Unreal,
    v1::Convention::Godot,
];

/// A request of the `OpenXR` convention in another one.
fn converted(openxr: &v1::FindGraspRequest, convention: v1::Convention) -> v1::FindGraspRequest {
    let engines = engines();
    let requests = engines.iter().map(|engine| engine.request(openxr));
    let mut requests = requests.chain([openxr.clone().with_convention(v1::Convention::Openxr)]);
    requests
        .find(|request| request.output.as_ref().unwrap().convention() == convention)
        .expect("there is an engine for it")
}

async fn find(server: &TestServer, request: &v1::FindGraspRequest) -> v1::FindGraspResponse {
    let answer = server.grasps().await.find_grasp(request.clone()).await;
    answer.expect("the request is valid").into_inner()
}

/// Checks that a hand in the convention of the saved one is where that is, with the same angles.
fn assert_same(saved: &v1::HandPose, seen: &v1::HandPose, what: &str) {
    assert_eq!(saved.convention(), seen.convention(), "{what}");
    assert_eq!(
        (&saved.rig, saved.handedness, saved.scale),
        (&seen.rig, seen.handedness, seen.scale),
        "{what}"
    );
    let unit = metre(saved.convention());
    for (saved, seen) in [
        (saved.client_from_wrist, seen.client_from_wrist),
        (saved.object_from_wrist, seen.object_from_wrist),
    ] {
        let [saved, seen] = [saved, seen].map(|pose| pose.expect("answers have both wrists"));
        let distance = saved.position().distance(seen.position()) / unit;
        assert!(distance <= ROUNDING, "{what}: {distance} m");
        let turn = angle_between(saved.orientation(), seen.orientation());
        assert!(turn <= ROUNDING, "{what}: {turn} rad");
    }
    for (saved, seen) in saved.digits().into_iter().zip(seen.digits()) {
        let [saved, seen] = [saved, seen].map(|digit| angles(digit.expect("the rig has all digits")));
        let off = (0..4).map(|joint| (saved[joint] - seen[joint]).abs());
        assert!(off.fold(0.0, f32::max) <= ROUNDING, "{what}: {saved:?} {seen:?}");
    }
}

/// Twice the sine of half the angle, which is exact for small ones.
fn angle_between(a: Quat, b: Quat) -> f32 {
    let between = a.conjugate() * b;
    2.0 * Vec3::new(between.x, between.y, between.z).length()
}

fn angles(digit: &v1::DigitAngles) -> [f32; 4] {
    let third = digit.third_pitch.expect("answers have all angles");
    [digit.base_yaw, digit.base_pitch, digit.second_pitch, third]
}

/// A request about the held remote, in each pair of conventions: that of the saved answer, and that of the request in which it comes
/// back. The answers to the former are found once.
async fn saved_answers(server: &TestServer, openxr: &v1::FindGraspRequest) -> Vec<v1::HandPose> {
    let mut saved = Vec::new();
    for convention in CONVENTIONS {
        let answer = find(server, &converted(openxr, convention)).await;
        let hand = answer.hand().expect("it can be taken").clone();
        assert_eq!(hand.convention(), convention);
        saved.push(hand);
    }
    saved
}

#[tokio::test(flavor = "multi_thread")]
async fn a_saved_answer_is_a_current_grasp_in_every_convention() {
    let server = TestServer::start().await;
    let openxr = held_remote().receiving(v1::Handedness::Right);
    for saved in saved_answers(&server, &openxr).await {
        for convention in CONVENTIONS {
            let what = format!("{:?} in {convention:?}", saved.convention());
            let request = with(converted(&openxr, convention), |request| {
                request.current = Some(v1::CurrentGrasp {
                    grasp: Some(saved.clone()),
                    ..Default::default()
                });
            });
            let answer = find(&server, &request).await;
            let current = answer.current.as_ref().expect("the request has one");
            assert_eq!(current.status(), CurrentGraspStatus::Kept, "{what}: {answer:?}");
            assert_eq!(answer.source(), v1::GraspSource::Current, "{what}");
            let kept = answer.hand().expect("it is kept");
            assert_eq!(kept.convention(), convention);
            assert_same_place(&server, &openxr, &saved, kept, &what).await;
        }
    }
    server.stop().await;
}

/// Checks that hands of two conventions are the same hand: in the saved one's convention, the other is where the saved one is.
async fn assert_same_place(
    server: &TestServer,
    openxr: &v1::FindGraspRequest,
    saved: &v1::HandPose,
    seen: &v1::HandPose,
    what: &str,
) {
    let request = request(converted(openxr, saved.convention()), seen.clone());
    let answer = validated(&mut server.grasps().await, request).await;
    let seen = answer.grasp.expect("the grasp is there");
    assert_same(saved, hand(&seen), what);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_saved_answer_is_a_grasp_to_validate_in_every_convention() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let openxr = held_remote().receiving(v1::Handedness::Right);
    for saved in saved_answers(&server, &openxr).await {
        for convention in CONVENTIONS {
            let what = format!("{:?} in {convention:?}", saved.convention());
            let answer = validated(
                &mut client,
                request(converted(&openxr, convention), saved.clone()),
            )
            .await;
            assert!(answer.valid, "{what}: {:#?}", answer.verdicts);
            let seen = answer.grasp.expect("the grasp is there");
            assert_eq!(hand(&seen).convention(), convention);
            assert_same_place(&server, &openxr, &saved, hand(&seen), &what).await;
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_saved_answer_is_a_known_grip_in_every_convention() {
    let server = TestServer::start().await;
    let mut objects = server.objects().await;
    let created = objects.create_object(box_request("crate")).await;
    let name = created.expect("the box is sound").into_inner().name;
    let openxr = with(held_remote(), |request| {
        request.holdout_mut().object.clone_from(&name);
        // Nobody holds it.
        request.holdout_mut().presenting_hand = None;
        request.receiver = Some(receiving(v1::Handedness::Right));
    });
    for (number, saved) in saved_answers(&server, &openxr).await.into_iter().enumerate() {
        let grips = vec![v1::KnownGrip::new(
            "saved",
            v1::Preference::Preferred,
            saved.clone(),
        )];
        let update = update_of(&name, |object| object.known_grips.clone_from(&grips));
        let updated = objects.update_object(masked(&["known_grips"], update)).await;
        updated.expect("an answer is a right grip");
        let create = with_object(box_request(&format!("crate-{number}")), |object| {
            object.known_grips = grips;
        });
        let created = objects.create_object(create).await;
        let created = created.expect("an answer is a right grip").into_inner().name;
        for (convention, name) in CONVENTIONS
            .into_iter()
            .flat_map(|convention| [(convention, &name), (convention, &created)])
        {
            let what = format!("{:?} in {convention:?}, {name}", saved.convention());
            let request = with(converted(&openxr, convention), |request| {
                request.holdout_mut().object.clone_from(name);
            });
            let answer = find(&server, &request).await;
            let origin = answer.origin.as_ref().expect("every answer has an origin");
            assert_eq!(
                (origin.source(), origin.known_grip.as_str()),
                (v1::GraspSource::KnownGrip, "saved"),
                "{what}: {answer:?}"
            );
            let held = answer.hand().expect("it is answered");
            assert_eq!(held.convention(), convention);
            assert_same_place(&server, &openxr, &saved, held, &what).await;
        }
    }
    server.stop().await;
}
