//! Constraints of a request are validated and met.

use grasp_proto::v1;
use grasp_tests::TestServer;

use crate::fixtures::{assert_blamed, floating_remote};

type Change = fn(&mut v1::Constraints);

fn vector(x: f32) -> v1::Vector3 {
    v1::Vector3 { x, y: 0.0, z: 0.0 }
}

/// Valid constraints, to be broken one by one.
fn valid_constraints() -> v1::Constraints {
    v1::Constraints {
        receiver_reach: Some(v1::Reach {
            client_shoulder: Some(vector(1.0)),
            reach: 0.7,
        }),
        approach: Some(v1::ApproachCone {
            client_direction: Some(vector(2.0)),
            half_angle: 0.5,
        }),
        allowed_grasp_types: vec![v1::GraspType::Tripod.into()],
        excluded_grasp_types: vec![v1::GraspType::Palmar.into()],
        must_touch: vec![v1::Digit::Thumb.into()],
        must_not_touch: vec![v1::Digit::Little.into()],
        max_comfort_e: Some(0.1),
    }
}

fn with_constraints(change: impl FnOnce(&mut v1::Constraints)) -> v1::FindGraspRequest {
    let mut constraints = valid_constraints();
    change(&mut constraints);
    v1::FindGraspRequest {
        constraints: Some(constraints),
        ..floating_remote()
    }
}

fn reach(constraints: &mut v1::Constraints) -> &mut v1::Reach {
    constraints.receiver_reach.as_mut().unwrap()
}

fn approach(constraints: &mut v1::Constraints) -> &mut v1::ApproachCone {
    constraints.approach.as_mut().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_constraint_is_validated() {
    let server = TestServer::start().await;
    let table: &[(&str, Change)] = &[
        ("receiver_reach.client_shoulder", |c| {
            reach(c).client_shoulder = None;
        }),
        ("receiver_reach.client_shoulder", |c| {
            reach(c).client_shoulder = Some(vector(f32::NAN));
        }),
        ("receiver_reach.client_shoulder", |c| {
            reach(c).client_shoulder = Some(vector(1e6));
        }),
        ("receiver_reach.reach", |c| reach(c).reach = 0.0),
        ("receiver_reach.reach", |c| reach(c).reach = -0.7),
        ("receiver_reach.reach", |c| reach(c).reach = f32::NAN),
        ("receiver_reach.reach", |c| reach(c).reach = f32::INFINITY),
        ("approach.client_direction", |c| {
            approach(c).client_direction = None;
        }),
        ("approach.client_direction", |c| {
            approach(c).client_direction = Some(vector(0.0));
        }),
        ("approach.client_direction", |c| {
            approach(c).client_direction = Some(vector(f32::INFINITY));
        }),
        ("approach.half_angle", |c| approach(c).half_angle = 0.0),
        ("approach.half_angle", |c| approach(c).half_angle = 3.2),
        ("approach.half_angle", |c| approach(c).half_angle = f32::NAN),
        ("allowed_grasp_types[1]", |c| c.allowed_grasp_types.push(0)),
        ("allowed_grasp_types[1]", |c| c.allowed_grasp_types.push(34)),
        ("excluded_grasp_types[1]", |c| c.excluded_grasp_types.push(0)),
        ("excluded_grasp_types[1]", |c| c.excluded_grasp_types.push(-1)),
        ("excluded_grasp_types[1]", |c| {
            c.excluded_grasp_types.push(v1::GraspType::Tripod.into());
        }),
        ("excluded_grasp_types", |c| {
            c.allowed_grasp_types.clear();
            c.excluded_grasp_types = (1..=33).collect();
        }),
        ("must_touch[1]", |c| c.must_touch.push(0)),
        ("must_touch[1]", |c| c.must_touch.push(6)),
        ("must_not_touch[1]", |c| c.must_not_touch.push(-1)),
        ("must_not_touch[1]", |c| {
            c.must_not_touch.push(v1::Digit::Thumb.into());
        }),
        ("max_comfort_e", |c| c.max_comfort_e = Some(-0.1)),
        ("max_comfort_e", |c| c.max_comfort_e = Some(f32::NAN)),
        ("max_comfort_e", |c| c.max_comfort_e = Some(f32::INFINITY)),
    ];
    for (field, change) in table {
        assert_blamed(
            &server,
            with_constraints(change),
            &[&format!("constraints.{field}")],
        )
        .await;
    }
    server.stop().await;
}

type Check = fn(&v1::Grasp) -> bool;

fn touching(grasp: &v1::Grasp) -> Vec<v1::Digit> {
    grasp.contacts.iter().map(v1::Contact::digit).collect()
}

/// Answers for some seeds without an atlas, each with the type of its grasp. For the thesis hand there are no
/// transferred grips, which would depend on the constraints: all searches start alike.
async fn typed_answers(
    server: &TestServer,
    validity: v1::Validity,
    allowed: &[v1::GraspType],
    excluded: &[v1::GraspType],
) -> Vec<(v1::GraspType, v1::SearchReport)> {
    let mut client = server.grasps().await;
    let numbers = |types: &[v1::GraspType]| types.iter().map(|&one| one.into()).collect();
    let mut answers = Vec::new();
    for seed in 0..30 {
        let request = v1::FindGraspRequest {
            seed: Some(seed),
            reproducible: true,
            validity: validity.into(),
            receiving_hand: Some(v1::ReceivingHand {
                rig: "thesis".to_owned(),
                ..Default::default()
            }),
            constraints: Some(v1::Constraints {
                allowed_grasp_types: numbers(allowed),
                excluded_grasp_types: numbers(excluded),
                ..Default::default()
            }),
            ..floating_remote()
        };
        let answer = client.find_grasp(request).await.unwrap().into_inner();
        let report = answer.report.unwrap();
        let grasp = answer
            .grasp
            .unwrap_or_else(|| panic!("{allowed:?}, {excluded:?}: {report:?}"));
        answers.push((grasp.r#type(), report));
    }
    answers
}

fn unmet(report: &v1::SearchReport) -> u64 {
    let of_kind = |count: &&v1::RejectionCount| count.rejection() == v1::Rejection::UnmetConstraint;
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
    let common = [
        (v1::Validity::Physical, Prismatic2Finger),
        (v1::Validity::Thesis, PalmarPinch),
    ];
    for (validity, common) in common {
        let any = typed_answers(&server, validity, &[], &[]).await;
        assert!(any.iter().all(|(_, report)| unmet(report) == 0));
        let types: Vec<_> = any.iter().map(|(one, _)| *one).collect();
        let is_other = |one: &v1::GraspType| ![common, Unspecified].contains(one);
        assert!(types.contains(&common), "{validity:?}: {types:?}");
        // Under PHYSICAL, grasps with a type are preferred.
        let has_untyped = validity == v1::Validity::Thesis;
        assert!(!has_untyped || types.contains(&Unspecified), "{types:?}");

        let allowed = typed_answers(&server, validity, &[common], &[]).await;
        assert!(
            allowed.iter().all(|(one, _)| *one == common),
            "{validity:?}: {allowed:?}"
        );
        // Where the first valid grasp was of another type, it was rejected.
        for (free, (_, report)) in types.iter().zip(&allowed) {
            assert!(*free == common || unmet(report) > 0, "{free:?}: {report:?}");
        }

        // Grasps of no type remain.
        let excluded = typed_answers(&server, validity, &[], &[common]).await;
        let types: Vec<_> = excluded.iter().map(|(one, _)| *one).collect();
        assert!(!types.contains(&common), "{validity:?}: {types:?}");
        assert!(!has_untyped || types.contains(&Unspecified), "{types:?}");

        let others: Vec<_> = (1..=33)
            .map(|number| v1::GraspType::try_from(number).expect("a type"))
            .filter(is_other)
            .collect();
        let of_others = typed_answers(&server, validity, &others, &[]).await;
        assert!(
            of_others.iter().all(|(one, _)| is_other(one)),
            "{validity:?}: {of_others:?}"
        );
    }
    server.stop().await;
}

fn wrist(grasp: &v1::Grasp) -> glam::Vec3 {
    let pose = grasp.client_from_wrist.as_ref().unwrap();
    let p = pose.position.as_ref().unwrap();
    glam::Vec3::new(p.x, p.y, p.z)
}

/// Each alone, with a check of every grasp.
#[tokio::test(flavor = "multi_thread")]
async fn each_constraint_is_met() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let table: [(Change, Check); 5] = [
        (
            |c| {
                c.receiver_reach = Some(v1::Reach {
                    client_shoulder: Some(v1::Vector3 {
                        x: 0.4,
                        y: 0.0,
                        z: 0.0,
                    }),
                    reach: 0.38,
                });
            },
            |grasp| wrist(grasp).distance(glam::Vec3::new(0.4, 0.0, 0.0)) <= 0.38 + 1e-5,
        ),
        (
            |c| c.must_touch = vec![v1::Digit::Little.into()],
            |grasp| touching(grasp).contains(&v1::Digit::Little),
        ),
        (
            |c| c.must_not_touch = vec![v1::Digit::Little.into()],
            |grasp| !touching(grasp).contains(&v1::Digit::Little),
        ),
        (|c| c.max_comfort_e = Some(0.01), |grasp| grasp.comfort <= 0.01),
        (
            |c| {
                c.approach = Some(v1::ApproachCone {
                    client_direction: Some(v1::Vector3 {
                        x: 0.0,
                        y: -1.0,
                        z: 0.0,
                    }),
                    half_angle: 0.8,
                });
            },
            |grasp| {
                // Halfway between the fingers and the palm's direction, in OpenXR axes.
                let o = grasp.client_from_wrist.as_ref().unwrap().orientation.unwrap();
                let turn = glam::Quat::from_xyzw(o.x, o.y, o.z, o.w);
                let way = turn * (glam::Vec3::NEG_Z + glam::Vec3::NEG_Y);
                way.angle_between(glam::Vec3::NEG_Y) <= 0.8 + 1e-3
            },
        ),
    ];
    for (row, (constrain, is_met)) in table.into_iter().enumerate() {
        for seed in 0..3 {
            let request = v1::FindGraspRequest {
                seed: Some(seed),
                budget: Some(prost_types::Duration {
                    seconds: 10,
                    nanos: 0,
                }),
                ..with_constraints(|constraints| {
                    *constraints = v1::Constraints::default();
                    constrain(constraints);
                })
            };
            let answer = client.find_grasp(request).await.unwrap().into_inner();
            let grasp = answer
                .grasp
                .unwrap_or_else(|| panic!("row {row}: {:?}", answer.report));
            assert!(is_met(&grasp), "row {row}, seed {seed}: {grasp:?}");
        }
    }
    server.stop().await;
}
