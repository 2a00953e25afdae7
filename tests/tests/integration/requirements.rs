//! Requirements of a request, and the receiver's reach, are validated and met.

use std::time::Duration;

use glam::Vec3;
use grasp_proto::v1::{self, receiver::Body};
use grasp_tests::TestServer;

use crate::{
    fixtures::{assert_blamed, floating_remote},
    parts::{hand as hand_of, reproducible, with},
};

type Change = fn(&mut v1::FindGraspRequest);

fn vector(x: f32) -> v1::Vector3 {
    v1::Vector3 { x, y: 0.0, z: 0.0 }
}

/// A request with valid requirements, to be broken one by one.
fn valid_request() -> v1::FindGraspRequest {
    v1::FindGraspRequest {
        receiver: Some(v1::Receiver {
            body: Some(Body::ClientShoulder(vector(1.0))),
            max_reach: Some(0.7),
            ..Default::default()
        }),
        requirements: Some(v1::Requirements {
            friction: None,
            client_approach: Some(vector(2.0)),
            max_approach_angle: 0.5,
            allowed_grasp_types: vec![v1::GraspType::Tripod.into()],
            excluded_grasp_types: vec![v1::GraspType::Palmar.into()],
            must_touch: vec![v1::Digit::Thumb.into()],
            must_not_touch: vec![v1::Digit::Little.into()],
            thesis: Some(v1::ThesisOptions {
                max_comfort: Some(0.1),
                ..Default::default()
            }),
        }),
        ..floating_remote()
    }
}

fn set_shoulder(request: &mut v1::FindGraspRequest, shoulder: v1::Vector3) {
    request.receiver_mut().body = Some(Body::ClientShoulder(shoulder));
}

fn set_comfort(request: &mut v1::FindGraspRequest, max_comfort: f32) {
    request.requirements_mut().thesis = Some(v1::ThesisOptions {
        max_comfort: Some(max_comfort),
        ..Default::default()
    });
}

#[tokio::test(flavor = "multi_thread")]
async fn every_requirement_is_validated() {
    let server = TestServer::start().await;
    let answer = server.grasps().await.find_grasp(valid_request()).await;
    assert!(answer.is_ok(), "the unchanged request is accepted: {answer:?}");
    let table: &[(&str, Change)] = &[
        ("receiver.max_reach", |r| r.receiver_mut().body = None),
        ("receiver.max_reach", |r| {
            r.receiver_mut().body = Some(Body::Anywhere(true));
        }),
        ("receiver.client_shoulder", |r| set_shoulder(r, vector(f32::NAN))),
        ("receiver.client_shoulder", |r| set_shoulder(r, vector(1e6))),
        ("receiver.max_reach", |r| r.receiver_mut().max_reach = Some(0.0)),
        ("receiver.max_reach", |r| r.receiver_mut().max_reach = Some(-0.7)),
        ("receiver.max_reach", |r| {
            r.receiver_mut().max_reach = Some(f32::NAN);
        }),
        ("receiver.max_reach", |r| {
            r.receiver_mut().max_reach = Some(f32::INFINITY);
        }),
        ("requirements.client_approach", |r| {
            r.requirements_mut().client_approach = None;
        }),
        ("requirements.client_approach", |r| {
            r.requirements_mut().client_approach = Some(vector(0.0));
        }),
        ("requirements.client_approach", |r| {
            r.requirements_mut().client_approach = Some(vector(f32::INFINITY));
        }),
        ("requirements.max_approach_angle", |r| {
            r.requirements_mut().max_approach_angle = 0.0;
        }),
        ("requirements.max_approach_angle", |r| {
            r.requirements_mut().max_approach_angle = 3.2;
        }),
        ("requirements.max_approach_angle", |r| {
            r.requirements_mut().max_approach_angle = f32::NAN;
        }),
        ("requirements.allowed_grasp_types[1]", |r| {
            r.requirements_mut().allowed_grasp_types.push(0);
        }),
        ("requirements.allowed_grasp_types[1]", |r| {
            r.requirements_mut().allowed_grasp_types.push(34);
        }),
        ("requirements.excluded_grasp_types[1]", |r| {
            r.requirements_mut().excluded_grasp_types.push(0);
        }),
        ("requirements.excluded_grasp_types[1]", |r| {
            r.requirements_mut().excluded_grasp_types.push(-1);
        }),
        ("requirements.excluded_grasp_types[1]", |r| {
            let tripod = v1::GraspType::Tripod.into();
            r.requirements_mut().excluded_grasp_types.push(tripod);
        }),
        ("requirements.excluded_grasp_types", |r| {
            r.requirements_mut().allowed_grasp_types.clear();
            r.requirements_mut().excluded_grasp_types = (1..=33).collect();
        }),
        ("requirements.must_touch[1]", |r| {
            r.requirements_mut().must_touch.push(0);
        }),
        ("requirements.must_touch[1]", |r| {
            r.requirements_mut().must_touch.push(6);
        }),
        ("requirements.must_not_touch[1]", |r| {
            r.requirements_mut().must_not_touch.push(-1);
        }),
        ("requirements.must_not_touch[1]", |r| {
            let thumb = v1::Digit::Thumb.into();
            r.requirements_mut().must_not_touch.push(thumb);
        }),
        ("requirements.thesis.max_comfort", |r| set_comfort(r, -0.1)),
        ("requirements.thesis.max_comfort", |r| set_comfort(r, f32::NAN)),
        ("requirements.thesis.max_comfort", |r| {
            set_comfort(r, f32::INFINITY);
        }),
    ];
    for (field, change) in table {
        assert_blamed(&server, with(valid_request(), change), &[field]).await;
    }
    server.stop().await;
}

type Check = fn(&v1::Grasp) -> bool;

fn touching(grasp: &v1::Grasp) -> Vec<v1::Digit> {
    grasp.contacts.iter().map(v1::Contact::digit).collect()
}

/// Answers for some seeds without an atlas, each with the type of its grasp. For the thesis hand there are no
/// transferred grips, which would depend on the requirements: all searches start alike.
async fn typed_answers(
    server: &TestServer,
    thesis_validity: bool,
    allowed: &[v1::GraspType],
    excluded: &[v1::GraspType],
) -> Vec<(v1::GraspType, v1::SearchReport)> {
    let mut client = server.grasps().await;
    let numbers = |types: &[v1::GraspType]| types.iter().map(|&one| one.into()).collect();
    let mut answers = Vec::new();
    for seed in 0..30 {
        let request = with(reproducible(floating_remote().with_seed(seed)), |request| {
            "rigs/thesis".clone_into(&mut request.receiver_mut().rig);
            request.requirements = Some(v1::Requirements {
                allowed_grasp_types: numbers(allowed),
                excluded_grasp_types: numbers(excluded),
                thesis: Some(v1::ThesisOptions {
                    thesis_validity,
                    ..Default::default()
                }),
                ..Default::default()
            });
        });
        let answer = client.find_grasp(request).await.unwrap().into_inner();
        let v1::FindGraspResponse { grasps, report, .. } = answer;
        let report = report.unwrap();
        let [grasp] = &grasps[..] else {
            panic!("{allowed:?}, {excluded:?}: {report:?}");
        };
        answers.push((grasp.r#type(), report));
    }
    answers
}

fn unmet(report: &v1::SearchReport) -> u64 {
    let of_kind = |count: &&v1::CheckCount| count.check() == v1::Check::Requirements;
    report
        .rejections
        .iter()
        .find(of_kind)
        .map_or(0, |count| count.count)
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_respect_allowed_and_excluded_types() {
    use v1::GraspType::{PalmarPinch, Prismatic2Finger, Unspecified};
    let server = TestServer::start().await;
    // Types that occur, or the rest would prove nothing.
    for (of_thesis, common) in [(false, Prismatic2Finger), (true, PalmarPinch)] {
        let any = typed_answers(&server, of_thesis, &[], &[]).await;
        assert!(any.iter().all(|(_, report)| unmet(report) == 0));
        let types: Vec<_> = any.iter().map(|(one, _)| *one).collect();
        let is_other = |one: &v1::GraspType| ![common, Unspecified].contains(one);
        assert!(types.contains(&common), "thesis {of_thesis}: {types:?}");
        // Physical grasps are preferred with a type.
        assert!(!of_thesis || types.contains(&Unspecified), "{types:?}");

        let allowed = typed_answers(&server, of_thesis, &[common], &[]).await;
        assert!(
            allowed.iter().all(|(one, _)| *one == common),
            "thesis {of_thesis}: {allowed:?}"
        );
        // Where the first valid grasp was of another type, it was rejected.
        for (free, (_, report)) in types.iter().zip(&allowed) {
            assert!(*free == common || unmet(report) > 0, "{free:?}: {report:?}");
        }

        // Grasps of no type remain.
        let excluded = typed_answers(&server, of_thesis, &[], &[common]).await;
        let types: Vec<_> = excluded.iter().map(|(one, _)| *one).collect();
        assert!(!types.contains(&common), "thesis {of_thesis}: {types:?}");
        assert!(!of_thesis || types.contains(&Unspecified), "{types:?}");

        let others: Vec<_> = (1..=33)
            .map(|number| v1::GraspType::try_from(number).expect("a type"))
            .filter(is_other)
            .collect();
        let of_others = typed_answers(&server, of_thesis, &others, &[]).await;
        assert!(
            of_others.iter().all(|(one, _)| is_other(one)),
            "thesis {of_thesis}: {of_others:?}"
        );
    }
    server.stop().await;
}

fn wrist(grasp: &v1::Grasp) -> v1::Pose {
    hand_of(grasp).client_from_wrist.expect("every grasp has a wrist")
}

/// Each alone, with a check of every grasp.
#[tokio::test(flavor = "multi_thread")]
async fn each_requirement_is_met() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let table: [(Change, Check); 5] = [
        (
            |r| {
                set_shoulder(r, vector(0.4));
                r.receiver_mut().max_reach = Some(0.38);
            },
            |grasp| wrist(grasp).position().distance(Vec3::X * 0.4) <= 0.38 + 1e-5,
        ),
        (
            |r| r.requirements_mut().must_touch = vec![v1::Digit::Little.into()],
            |grasp| touching(grasp).contains(&v1::Digit::Little),
        ),
        (
            |r| r.requirements_mut().must_not_touch = vec![v1::Digit::Little.into()],
            |grasp| !touching(grasp).contains(&v1::Digit::Little),
        ),
        (
            |r| set_comfort(r, 0.01),
            |grasp| grasp.thesis.expect("it has a comfort").comfort <= 0.01,
        ),
        (
            |r| {
                r.requirements_mut().client_approach = Some(Vec3::NEG_Y.into());
                r.requirements_mut().max_approach_angle = 0.8;
            },
            |grasp| {
                // Halfway between the fingers and the palm's direction, in OpenXR axes.
                let way = wrist(grasp).orientation() * (Vec3::NEG_Z + Vec3::NEG_Y);
                way.angle_between(Vec3::NEG_Y) <= 0.8 + 1e-3
            },
        ),
    ];
    for (row, (constrain, is_met)) in table.into_iter().enumerate() {
        for seed in 0..3 {
            let request = floating_remote()
                .with_seed(seed)
                .with_budget(Duration::from_secs(10));
            let answer = client.find_grasp(with(request, constrain)).await;
            let answer = answer.unwrap().into_inner();
            let grasp = answer.grasp();
            let grasp = grasp.unwrap_or_else(|| panic!("row {row}: {:?}", answer.report));
            assert!(is_met(grasp), "row {row}, seed {seed}: {grasp:?}");
        }
    }
    server.stop().await;
}
