//! Grips of an object that its owner knows, tried first or not answered, and current grasps: kept, replaced, aborted.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_assets::holdouts::holdouts;
use grasp_client::{GraspClient, built_in::request_for};
use grasp_proto::v1::{self, Convention, CurrentGraspStatus, GraspSource, Handedness};
use grasp_tests::TestServer;

use crate::fixtures::{
    box_request, find, hand as hand_of, masked, reproducible, update_of, with, with_object,
};

/// Default neighbourhood of a forbidden grip, in metres and radians.
const NEAR: (f32, f32) = (0.03, 0.5);

/// A request to create the box with these grips.
fn box_with(id: &str, known_grips: Vec<v1::KnownGrip>) -> v1::CreateObjectRequest {
    with_object(box_request(id), |object| object.known_grips = known_grips)
}

async fn server_with_box(known_grips: Vec<v1::KnownGrip>) -> TestServer {
    let server = TestServer::start().await;
    let client = server.client().await;
    let created = client.create_object(&box_with("crate", known_grips)).await;
    created.expect("the box is sound");
    server
}

/// Gives the box these grips alone, which the answer must list as they were sent.
async fn replace_grips(client: &GraspClient, grips: &[v1::KnownGrip]) {
    let update = update_of("objects/crate", |object| object.known_grips = grips.to_vec());
    let update = masked(&["known_grips"], update);
    let changed = client.update_object(&update).await;
    assert_eq!(changed.expect("the update is right").known_grips, grips);
}

fn request(seed: u64) -> v1::FindGraspRequest {
    let request = v1::FindGraspRequest::new("objects/crate")
        .with_seed(seed)
        .with_budget(Duration::from_secs(10))
        .receiving(Handedness::Right);
    reproducible(request)
}

/// The name of the known grip that an answer is; empty if it is none.
fn known_grip(answer: &v1::FindGraspResponse) -> &str {
    &answer
        .origin
        .as_ref()
        .expect("every answer has an origin")
        .known_grip
}

/// The hand that holds the box in an answer.
async fn hand_found(server: &TestServer, request: &v1::FindGraspRequest) -> v1::HandPose {
    let answer = find(server, request.clone()).await;
    hand_of(answer.grasp().expect("a box can be held")).clone()
}

/// A hand that the service finds for the box.
async fn found(seed: u64) -> v1::HandPose {
    let server = server_with_box(Vec::new()).await;
    let hand = hand_found(&server, &request(seed)).await;
    server.stop().await;
    hand
}

/// The fields of an answered hand that an object keeps.
fn kept(hand: &v1::HandPose) -> v1::HandPose {
    v1::HandPose {
        client_from_wrist: None,
        joints: Vec::new(),
        model: Vec::new(),
        ..hand.clone()
    }
}

fn preferred(hand: &v1::HandPose) -> v1::KnownGrip {
    v1::KnownGrip::new("mine", v1::Preference::Preferred, kept(hand))
}

/// How far two hands' wrists are apart in the object's frame, in metres and radians.
fn distances(a: &v1::HandPose, b: &v1::HandPose) -> (f32, f32) {
    let [a, b] = [a, b].map(|hand| hand.object_from_wrist.expect("it is at the object"));
    (
        a.position().distance(b.position()),
        a.orientation().angle_between(b.orientation()),
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn a_valid_preferred_grip_is_answered_whatever_else_there_is() {
    let mine = found(3).await;
    let server = server_with_box(vec![preferred(&mine)]).await;
    for choice in [
        v1::GraspChoice::FirstValid,
        v1::GraspChoice::Reproducible,
        v1::GraspChoice::BestWithinBudget,
    ] {
        for seed in 0..4 {
            let request = with(request(seed), |request| {
                request.search_mut().choice = choice.into();
            })
            .with_budget(Duration::from_millis(300));
            let answer = find(&server, request.clone()).await;
            assert_eq!(answer.source(), GraspSource::KnownGrip, "{request:?}");
            assert_eq!(known_grip(&answer), "mine");
            let answered = hand_of(answer.grasp().expect("the source says so"));
            let (shift, turn) = distances(answered, &mine);
            assert!(shift < 1e-4 && turn < 1e-3, "{shift} m, {turn} rad");
            for (new, old) in answered.digits().into_iter().zip(mine.digits()) {
                let [new, old] = [new, old].map(|digit| digit.expect("it has all digits"));
                assert!((new.base_pitch - old.base_pitch).abs() < 0.02);
            }
        }
    }
    // The grip is of the right hand only.
    let left = request(0).receiving(Handedness::Left);
    assert_ne!(find(&server, left).await.source(), GraspSource::KnownGrip);
    // It also comes first in requests for either hand.
    let either = request(0).receiving(Handedness::Unspecified);
    assert_eq!(find(&server, either).await.source(), GraspSource::KnownGrip);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_preferred_grip_that_the_giver_blocks_is_not_answered() {
    let mine = found(3).await;
    let server = server_with_box(vec![preferred(&mine)]).await;
    // The giver holds the box with the very same grip.
    let answer = find(&server, request(0).with_presenting_hand(mine)).await;
    assert_ne!(answer.source(), GraspSource::KnownGrip);
    assert_eq!(known_grip(&answer), "");
    let report = answer.report.expect("every answer has a report");
    let [passed_over] = report.passed_over.as_slice() else {
        panic!("{:?}", report.passed_over);
    };
    assert_eq!(
        (
            passed_over.subject.as_str(),
            passed_over.check(),
            passed_over.passed
        ),
        ("mine", v1::Check::GiverClearance, false)
    );
    // Where nothing was passed over, nothing is reported.
    let report = find(&server, request(0)).await.report;
    assert_eq!(report.expect("every answer has a report").passed_over, []);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_saved_answer_is_a_known_grip_in_the_convention_that_it_was_answered_in() {
    let in_openxr = found(3).await;
    let server = server_with_box(Vec::new()).await;
    let client = server.client().await;
    for convention in [
        Convention::Openxr,
        Convention::Unity,
        Convention::Unreal,
        Convention::Godot,
        Convention::UnityFlipX,
        Convention::UnrealXzy,
    ] {
        replace_grips(&client, &[]).await;
        let saved = hand_found(&server, &request(3).with_convention(convention)).await;
        replace_grips(&client, &[preferred(&saved)]).await;
        let answer = find(&server, request(0)).await;
        assert_eq!(known_grip(&answer), "mine", "{convention:?}");
        let answered = hand_of(answer.grasp().expect("the source says so"));
        let (shift, turn) = distances(answered, &in_openxr);
        assert!(
            shift < 1e-4 && turn < 1e-3,
            "{convention:?}: {shift} m, {turn} rad"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_stay_beyond_the_neighbourhood_of_forbidden_grips() {
    let server = server_with_box(Vec::new()).await;
    let client = server.client().await;
    let mut forbidden: Vec<v1::KnownGrip> = Vec::new();
    for round in 0..6 {
        let at_random = with(request(round), |request| {
            request.search_mut().choice = v1::GraspChoice::FirstValid.into();
        });
        for request in [request(3), at_random.receiving(Handedness::Unspecified)] {
            let hand = hand_found(&server, &request).await;
            for grip in &forbidden {
                let other = grip.hand.as_ref().expect("it was sent");
                if other.handedness() == hand.handedness() {
                    let (shift, turn) = distances(other, &hand);
                    assert!(
                        shift >= NEAR.0 || turn >= NEAR.1,
                        "{shift} m, {turn} rad from {}",
                        grip.name
                    );
                }
            }
            let name = format!("forbidden {}", forbidden.len());
            forbidden.push(v1::KnownGrip::new(name, v1::Preference::Forbidden, kept(&hand)));
            replace_grips(&client, &forbidden).await;
        }
    }
    // Another change keeps them; an empty list removes them.
    let heavier = update_of("objects/crate", |object| object.mass_kg = 0.12);
    let changed = client.update_object(&heavier).await;
    assert_eq!(changed.expect("the update is right").known_grips, forbidden);
    replace_grips(&client, &[]).await;
}

/// A request for an object of a built-in holdout, by right hands.
fn of_holdout(holdout: usize) -> v1::FindGraspRequest {
    request_for(&holdouts()[holdout])
        .receiving(v1::Handedness::Right)
        .with_budget(Duration::from_secs(10))
        .with_seed(3)
}

/// The same where nobody holds the object.
fn without_giver(holdout: usize) -> v1::FindGraspRequest {
    with(of_holdout(holdout), |request| {
        request.holdout_mut().presenting_hand = None;
    })
}

/// The grasp that is found.
async fn found_for(server: &TestServer, request: &v1::FindGraspRequest) -> v1::Grasp {
    let answer = find(server, request.clone()).await;
    answer.grasp().expect("a grasp").clone()
}

/// The request once more with its answer to hold on to, as it is.
fn again(request: &v1::FindGraspRequest, grasp: &v1::Grasp) -> v1::FindGraspRequest {
    request.clone().with_current(v1::CurrentGrasp {
        grasp: grasp.hand.clone(),
        ..Default::default()
    })
}

fn report(answer: &v1::FindGraspResponse) -> &v1::CurrentGraspReport {
    answer.current.as_ref().expect("the request has one")
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_is_kept_bit_for_bit_in_every_convention() {
    let server = TestServer::start().await;
    for holdout in 0..15 {
        for convention in [
            v1::Convention::Openxr,
            v1::Convention::Unity,
            v1::Convention::Unreal,
            v1::Convention::Godot,
        ] {
            // Nobody holds it, so that poses need no conversion here.
            let at = v1::Pose::new(Vec3::new(0.1, 0.2, 0.3), Quat::from_rotation_y(0.4));
            let request = without_giver(holdout)
                .with_convention(convention)
                .with_client_from_object(at);
            let mut grasp = found_for(&server, &request).await;
            for round in 0..3 {
                let answer = find(&server, again(&request, &grasp)).await;
                assert_eq!(
                    report(&answer).status(),
                    CurrentGraspStatus::Kept,
                    "{holdout} {convention:?} {answer:?}"
                );
                assert_eq!(answer.source(), v1::GraspSource::Current);
                assert_eq!(answer.attempts(), 0);
                let [kept] = &answer.grasps[..] else {
                    panic!("it is kept: {answer:?}");
                };
                let (hand, before) = (hand_of(kept), hand_of(&grasp));
                assert_eq!(
                    hand.object_from_wrist, before.object_from_wrist,
                    "{holdout} {convention:?} {round}"
                );
                assert_eq!(hand.digits(), before.digits());
                for (kept, before) in hand.joints.iter().zip(&before.joints) {
                    assert!(
                        kept.orientation().dot(before.orientation()) > 0.9999,
                        "the sign is the same"
                    );
                    assert!(kept.position().distance(before.position()) < 1e-4);
                }
                let motion = report(&answer).motion.expect("the same hand");
                assert!(motion.distance == 0.0 && motion.angle < 1e-5 && motion.fingertips == 0.0);
                grasp = kept.clone();
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_committed_hand_aborts_and_its_withdrawal_can_be_sent_as_the_present_hand() {
    let server = TestServer::start().await;
    let request = without_giver(0);
    let grasp = found_for(&server, &request).await;
    // The giver's hand is where the receiver's is.
    let blocked = again(&request, &grasp).with_presenting_hand(hand_of(&grasp).clone());
    let committed = with(blocked, |request| {
        request.current.as_mut().unwrap().committed = true;
    });
    let answer = find(&server, committed).await;
    assert_eq!(answer.outcome(), v1::Outcome::Aborted);
    assert_eq!((answer.grasps.len(), answer.attempts()), (0, 0));
    let current = report(&answer);
    assert_eq!(current.status(), CurrentGraspStatus::Aborted);
    let failed = current.failed_check.as_ref().expect("it is not valid");
    assert_eq!(
        (failed.check(), failed.passed),
        (v1::Check::GiverClearance, false)
    );
    let withdrawal = current.withdrawal.as_ref().expect("a pose to withdraw to");
    let at = withdrawal
        .object_from_wrist
        .expect("a hand has a wrist")
        .position();
    let back = at.distance(grasp.object_from_wrist().unwrap().position());
    assert!((0.1..0.2).contains(&back), "{back}");
    let present = with(again(&request, &grasp), |request| {
        request.current.as_mut().unwrap().hand = Some(withdrawal.clone());
    });
    let answer = find(&server, present).await;
    assert_eq!(report(&answer).status(), CurrentGraspStatus::Kept);
    let motion = report(&answer).motion.expect("the same hand");
    assert!((motion.distance - back).abs() < 1e-5 && motion.fingertips > 0.005);
}
