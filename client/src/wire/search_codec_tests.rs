use std::time::Duration;

use glam::Vec3;

use super::*;
use crate::{
    constraints::Constraints,
    hand::{Digit, DigitAngles, HandAngles, Handedness, JOINT_COUNT, Phalanx, PresentingHand},
    obstacle::Obstacle,
    pose::Pose,
    query::Convention,
    receiver::{Arm, Receiver, ReceiverStance},
};

fn wire_vector(x: f32) -> v1::Vector3 {
    v1::Vector3 { x, y: 0.0, z: 0.0 }
}

/// An answer whose numbers are all different, to detect swapped fields.
fn wire_answer() -> v1::FindGraspResponse {
    v1::FindGraspResponse {
        outcome: v1::Outcome::Found.into(),
        grasp: Some(wire_grasp()),
        other_grasp: None,
        standing: None,
        report: Some(wire_report()),
    }
}

fn wire_grasp() -> v1::Grasp {
    v1::Grasp {
        rig: "thesis".to_owned(),
        handedness: v1::Handedness::Left.into(),
        client_from_wrist: Some(v1::Pose {
            position: Some(wire_vector(1.0)),
            orientation: None,
        }),
        object_from_wrist: Some(v1::Pose {
            position: Some(wire_vector(2.0)),
            orientation: None,
        }),
        digits: vec![v1::DigitAngles::default(); 5],
        joints: (0..26_u8)
            .map(|i| v1::JointPose {
                client_from_joint: None,
                radius: f32::from(i),
            })
            .collect(),
        contacts: vec![v1::Contact {
            torsion: 0.002,
            client_position: Some(wire_vector(3.0)),
            client_normal: Some(wire_vector(4.0)),
            object_position: Some(wire_vector(5.0)),
            object_normal: Some(wire_vector(6.0)),
            digit: v1::Digit::Ring.into(),
            phalanx: v1::Phalanx::Third.into(),
            triangle: 7,
            client_force: Some(wire_vector(8.0)),
            object_force: Some(wire_vector(9.0)),
        }],
        margins: Some(v1::PhysicalMargins {
            residual: 0.01,
            epsilon: 0.03,
            penetration: 0.001,
            giver_clearance: Some(0.031),
            obstacle_clearance: Some(0.032),
        }),
        comfort: 10.0,
        wrench_angle: 11.0,
        r#type: v1::GraspType::Quadpod.into(),
        type_confidence: 0.75,
        hangs: true,
        model: Some(v1::PosedModel {
            root_node: "hand_l".to_owned(),
            client_from_root: None,
            scale: 1.5,
            nodes: vec![v1::NodePose {
                node: "index_01_l".to_owned(),
                rotation: Some(v1::Quaternion {
                    x: 0.6,
                    y: 0.0,
                    z: 0.0,
                    w: 0.8,
                }),
                translation: None,
            }],
        }),
        arm: Some(v1::Arm {
            client_shoulder: Some(wire_vector(0.41)),
            client_elbow: Some(wire_vector(0.42)),
            wrist_flexion: 0.43,
            wrist_deviation: -0.44,
            assumed: true,
        }),
        score: Some(v1::Score {
            total: 0.21,
            terms: vec![v1::ScoreTerm {
                name: "comfort".to_owned(),
                value: 0.22,
                weight: 0.23,
            }],
        }),
        key_frames: [v1::KeyFrameKind::Approach, v1::KeyFrameKind::Close]
            .map(wire_key_frame)
            .to_vec(),
    }
}

fn wire_report() -> v1::SearchReport {
    v1::SearchReport {
        attempts: 12,
        pruned_placements: 13,
        rejections: vec![
            v1::RejectionCount {
                rejection: v1::Rejection::PalmCollision.into(),
                count: 14,
            },
            v1::RejectionCount {
                rejection: 99,
                count: 15,
            },
        ],
        step_times: vec![v1::StepTime {
            step: v1::Step::FingerPosing.into(),
            time: Some(prost_types::Duration {
                seconds: 16,
                nanos: 0,
            }),
        }],
        seed: u64::MAX,
        attempt: Some(17),
        search_time: Some(prost_types::Duration {
            seconds: 0,
            nanos: 18,
        }),
        budget: Some(prost_types::Duration {
            seconds: 19,
            nanos: 0,
        }),
        workers: 20,
        nearest_miss: None,
        strategy: v1::Strategy::F.into(),
        validity: v1::Validity::Thesis.into(),
        candidates: 24,
        source: v1::GraspSource::Atlas.into(),
        atlas_entries: 25,
        atlas_stamp: "26".to_owned(),
        other_atlas_stamp: "33".to_owned(),
        learned_stamp: "34".to_owned(),
        other_learned_stamp: "35".to_owned(),
        preferred_grip: "by the rim".to_owned(),
        passed_over: vec![v1::PassedOverGrip {
            name: "by the ear".to_owned(),
            fall: Some(v1::Fall {
                reason: v1::FallReason::Giver.into(),
                figure: Some(0.001),
                bound: None,
                description: "36".to_owned(),
            }),
        }],
        limits: vec![
            v1::Limit {
                kind: v1::LimitKind::Torque.into(),
                value: 28.0,
                bound: Some(29.0),
                description: "30".to_owned(),
            },
            v1::Limit {
                kind: 99,
                value: 31.0,
                bound: None,
                description: "32".to_owned(),
            },
        ],
        warnings: vec!["27".to_owned()],
    }
}

fn wire_key_frame(kind: v1::KeyFrameKind) -> v1::KeyFrame {
    v1::KeyFrame {
        kind: kind.into(),
        client_from_wrist: Some(v1::Pose {
            position: Some(wire_vector(27.0)),
            orientation: None,
        }),
        digits: vec![v1::DigitAngles::default(); 5],
        joints: vec![v1::JointPose::default(); JOINT_COUNT],
        model: None,
    }
}

fn path_of(answer: v1::FindGraspResponse) -> String {
    find_answer_from_wire(answer).unwrap_err().path
}

#[test]
fn converts_every_number_of_an_answer() {
    let answer = find_answer_from_wire(wire_answer()).unwrap();
    let grasp = answer.grasp.unwrap();
    assert_eq!(grasp.handedness, Handedness::Left);
    assert_eq!(grasp.client_from_wrist.position.x, 1.0);
    assert_eq!(grasp.object_from_wrist.position.x, 2.0);
    assert_eq!(
        grasp.joints.map(|joint| joint.radius),
        std::array::from_fn::<f32, JOINT_COUNT, _>(|i| i as f32)
    );
    let expected = Contact {
        torsion: 0.002,
        client_position: Vec3::X * 3.0,
        client_normal: Vec3::X * 4.0,
        object_position: Vec3::X * 5.0,
        object_normal: Vec3::X * 6.0,
        digit: Some(Digit::Ring),
        phalanx: Some(Phalanx::Third),
        triangle: 7,
        client_force: Vec3::X * 8.0,
        object_force: Vec3::X * 9.0,
    };
    assert_eq!(grasp.contacts, [expected]);
    assert_eq!((grasp.comfort, grasp.wrench_angle), (10.0, 11.0));
    assert_eq!(
        (grasp.grasp_type, grasp.type_confidence),
        (Some(GraspType::Quadpod), 0.75)
    );
    let margins = grasp.margins.unwrap();
    assert_eq!(margins.epsilon, 0.03);
    assert_eq!(
        (margins.giver_clearance, margins.obstacle_clearance),
        (Some(0.031), Some(0.032))
    );
    let arm = Arm {
        client_shoulder: Vec3::X * 0.41,
        client_elbow: Vec3::X * 0.42,
        wrist_flexion: 0.43,
        wrist_deviation: -0.44,
        assumed: true,
    };
    assert_eq!(grasp.arm, Some(arm));
    let score = grasp.score.unwrap();
    let term = &score.terms[0];
    assert_eq!(
        (score.total, term.name.as_str(), term.value, term.weight),
        (0.21, "comfort", 0.22, 0.23)
    );
    let model = grasp.model.as_ref().expect("it has a model");
    assert_eq!((model.root_node.as_str(), model.scale), ("hand_l", 1.5));
    assert_eq!(model.nodes[0].rotation.x, 0.6);
    let kinds: Vec<_> = grasp.key_frames.iter().map(|frame| frame.kind).collect();
    assert_eq!(kinds, [KeyFrameKind::Approach, KeyFrameKind::Close]);
    assert_eq!(grasp.key_frames[1].client_from_wrist.position.x, 27.0);
    let report = answer.report;
    assert_eq!((report.candidates, report.atlas_entries), (24, 25));
    assert_eq!(report.source, Some(GraspSource::Atlas));
    assert_eq!(report.atlas_stamp.as_deref(), Some("26"));
    assert_eq!(report.other_atlas_stamp.as_deref(), Some("33"));
    assert_eq!(report.learned_stamp.as_deref(), Some("34"));
    assert_eq!(report.other_learned_stamp.as_deref(), Some("35"));
    assert_eq!(report.preferred_grip.as_deref(), Some("by the rim"));
    let passed_over = &report.passed_over[0];
    assert_eq!(
        (
            passed_over.name.as_str(),
            passed_over.fall.reason,
            passed_over.fall.figure
        ),
        ("by the ear", crate::standing::FallReason::Giver, Some(0.001))
    );
    let limits = [
        (LimitKind::Torque, 28.0, Some(29.0), "30"),
        (LimitKind::Unrecognised, 31.0, None, "32"),
    ];
    let limits = limits.map(|(kind, value, bound, description)| Limit {
        kind,
        value,
        bound,
        description: description.to_owned(),
    });
    assert_eq!(report.limits, limits);
    assert_eq!(report.warnings, ["27"]);
    assert_eq!((report.attempts, report.pruned_placements), (12, 13));
    assert_eq!(report.rejections[0].rejection, Rejection::PalmCollision);
    assert_eq!(report.rejections[0].count, 14);
    assert_eq!(report.step_times[0].step, Step::FingerPosing);
    assert_eq!(report.step_times[0].time, Duration::from_secs(16));
    assert_eq!((report.seed, report.attempt), (u64::MAX, Some(17)));
    assert_eq!(report.search_time, Duration::from_nanos(18));
    assert_eq!(report.budget, Duration::from_secs(19));
    assert_eq!(report.workers, 20);
    assert_eq!(
        (report.strategy, report.validity),
        (Some(Strategy::F), Some(Validity::Thesis))
    );
}

#[test]
fn accepts_unknown_values_of_newer_servers() {
    let mut wire = wire_answer();
    let report = wire.report.as_mut().unwrap();
    report.strategy = 77;
    report.validity = 77;
    report.source = 77;
    report.step_times[0].step = 77;
    let grasp = wire.grasp.as_mut().unwrap();
    grasp.key_frames[0].kind = 77;
    grasp.r#type = 77;
    let answer = find_answer_from_wire(wire).unwrap();
    let grasp = answer.grasp.unwrap();
    assert_eq!(grasp.key_frames[0].kind, KeyFrameKind::Unrecognised);
    assert_eq!(grasp.grasp_type, None);
    let report = answer.report;
    assert_eq!(report.source, None);
    assert_eq!(report.rejections[1].rejection, Rejection::Unrecognised);
    assert_eq!(report.rejections[1].count, 15);
    assert_eq!((report.strategy, report.validity), (None, None));
    assert_eq!(report.step_times[0].step, Step::Unrecognised);
}

#[test]
fn knows_every_rejection_by_its_name() {
    let known = (1..).map_while(|value| v1::Rejection::try_from(value).ok());
    let mut count = 0;
    for wire in known {
        let name = serde_json::to_value(rejection_from_wire(wire.into())).unwrap();
        let expected = wire.as_str_name().trim_start_matches("REJECTION_").to_lowercase();
        assert_eq!(name, expected);
        count += 1;
    }
    assert_eq!(count, 9);
}

#[test]
fn grasp_types_keep_their_names() {
    for (number, grasp_type) in (1..).zip(GraspType::ALL) {
        let wire = v1::GraspType::try_from(number).unwrap();
        let name = serde_json::to_value(grasp_type).unwrap();
        let name = name.as_str().unwrap().to_uppercase();
        assert_eq!(format!("GRASP_TYPE_{name}"), wire.as_str_name());
        assert_eq!(grasp_type_from_wire(wire.into()), Some(grasp_type));
    }
    assert_eq!(grasp_type_from_wire(v1::GraspType::Unspecified.into()), None);
}

#[test]
fn rejects_grasp_that_contradicts_outcome() {
    let mut without_grasp = wire_answer();
    without_grasp.grasp = None;
    assert_eq!(path_of(without_grasp.clone()), "grasp");
    without_grasp.outcome = v1::Outcome::BudgetExhausted.into();
    let answer = find_answer_from_wire(without_grasp).unwrap();
    assert_eq!((answer.outcome, answer.grasp), (Outcome::BudgetExhausted, None));
    let mut with_grasp = wire_answer();
    with_grasp.outcome = v1::Outcome::BudgetExhausted.into();
    assert_eq!(path_of(with_grasp.clone()), "grasp");
    with_grasp.outcome = 42;
    assert_eq!(path_of(with_grasp), "outcome");
    let mut with_other_grasp = wire_answer();
    with_other_grasp.other_grasp = with_other_grasp.grasp.take();
    assert_eq!(path_of(with_other_grasp), "other_grasp");
}

#[test]
fn malformed_answer_is_rejected_with_field_path() {
    let mut wire = wire_answer();
    wire.report = None;
    assert_eq!(path_of(wire), "report");

    let mut wire = wire_answer();
    wire.grasp.as_mut().unwrap().joints.pop();
    assert_eq!(
        find_answer_from_wire(wire).unwrap_err(),
        Malformed::new("joints", "has 25 elements instead of 26").within("grasp")
    );

    let mut wire = wire_answer();
    wire.grasp.as_mut().unwrap().contacts[0].client_force = None;
    assert_eq!(path_of(wire), "grasp.contacts[0].client_force");

    let mut wire = wire_answer();
    wire.grasp.as_mut().unwrap().key_frames[1].digits.pop();
    assert_eq!(path_of(wire), "grasp.key_frames[1].digits");

    let mut wire = wire_answer();
    wire.grasp.as_mut().unwrap().arm.as_mut().unwrap().client_elbow = None;
    assert_eq!(path_of(wire), "grasp.arm.client_elbow");

    let mut wire = wire_answer();
    wire.report.as_mut().unwrap().step_times[0].time = None;
    assert_eq!(path_of(wire), "report.step_times[0].time");
}

#[test]
fn default_request_leaves_everything_to_the_server() {
    let wire = find_request_to_wire(&FindRequest::new("objects/remote"));
    assert_eq!(wire.object, "objects/remote");
    assert_eq!(wire.strategy(), v1::Strategy::Unspecified);
    assert_eq!(wire.bend_ratios(), v1::BendRatios::Unspecified);
    assert_eq!(wire.validity(), v1::Validity::Unspecified);
    assert_eq!(wire.choice(), v1::Choice::Unspecified);
    assert_eq!(wire.atlas(), v1::AtlasUse::Unspecified);
    assert_eq!(wire.hands(), v1::Hands::Unspecified);
    assert_eq!(wire.constraints, None);
    assert_eq!((wire.receiver, wire.improvement), (None, None));
    assert_eq!(wire.receiver_stance(), v1::ReceiverStance::Unspecified);
    assert!(!wire.plan_key_frames);
    assert!(wire.other_hands.is_empty() && wire.obstacles.is_empty());
    assert_eq!(wire.convention(), v1::Convention::Openxr);
    assert_eq!((wire.budget, wire.seed, wire.up), (None, None, None));
}

fn hand(handedness: Handedness) -> PresentingHand {
    PresentingHand::Angles(HandAngles {
        rig: "adult".to_owned(),
        handedness,
        client_from_wrist: Pose::IDENTITY,
        digits: [DigitAngles::default(); 5],
        hand_scale: None,
    })
}

#[test]
fn a_request_without_a_giver_presents_the_first_hand() {
    let request = FindRequest::new("objects/remote")
        .with_hand(hand(Handedness::Left))
        .with_hand(hand(Handedness::Right))
        .with_obstacle(Obstacle::capsule(Vec3::ZERO, Vec3::ZERO, 0.1));
    assert_eq!(request.presenting_hand, Some(hand(Handedness::Left)));
    assert_eq!(request.other_hands, [hand(Handedness::Right)]);
    assert_eq!(request.obstacles.len(), 1);
}

#[test]
fn converts_every_field_of_a_request() {
    let request = FindRequest {
        up: Some(Vec3::Z),
        budget: Some(Duration::from_millis(1500)),
        max_attempts: Some(1),
        strategy: Some(Strategy::D),
        bend_ratios: Some(BendRatios::OnlyHigh),
        validity: Some(Validity::Thesis),
        seed: Some(2),
        reproducible: true,
        only_attempt: Some(3),
        record_step_times: true,
        convention: Convention::Unreal,
        friction: Some(0.5),
        constraints: Constraints {
            max_comfort_e: Some(0.25),
            ..Constraints::default()
        },
        choice: Some(Choice::BestWithinBudget),
        atlas: Some(AtlasUse::None),
        plan_key_frames: true,
        other_hands: vec![hand(Handedness::Left), hand(Handedness::Right)],
        obstacles: vec![Obstacle::capsule(Vec3::X, Vec3::Y, 0.1)],
        hands: Some(Hands::Both),
        receiver: Some(Receiver::with_shoulder(Vec3::X)),
        receiver_stance: Some(ReceiverStance::Any),
        improvement: Some(Duration::from_millis(2)),
        object_scale: Some(1.25),
        object_mass_kg: Some(0.3),
        ..FindRequest::new("objects/remote")
    };
    let wire = find_request_to_wire(&request);
    assert_eq!(wire.up.unwrap().z, 1.0);
    let budget = wire.budget.unwrap();
    assert_eq!((budget.seconds, budget.nanos), (1, 500_000_000));
    assert_eq!(
        (wire.max_attempts, wire.seed, wire.only_attempt),
        (Some(1), Some(2), Some(3))
    );
    assert_eq!(wire.strategy(), v1::Strategy::D);
    assert_eq!(wire.bend_ratios(), v1::BendRatios::OnlyHigh);
    assert_eq!(wire.validity(), v1::Validity::Thesis);
    assert!(wire.reproducible && wire.record_step_times);
    assert_eq!(wire.convention(), v1::Convention::Unreal);
    assert_eq!(wire.friction, Some(0.5));
    assert_eq!(wire.choice(), v1::Choice::BestWithinBudget);
    assert_eq!(wire.atlas(), v1::AtlasUse::None);
    assert!(wire.plan_key_frames);
    assert_eq!(
        wire.other_hands,
        request
            .other_hands
            .iter()
            .map(presenting_hand_to_wire)
            .collect::<Vec<_>>()
    );
    assert_ne!(wire.other_hands[0], wire.other_hands[1]);
    assert_eq!(wire.obstacles, [obstacle_to_wire(&request.obstacles[0])]);
    assert_eq!(wire.hands(), v1::Hands::Both);
    let body = v1::receiver::Body::ClientShoulder(wire_vector(1.0));
    assert_eq!(wire.receiver.unwrap().body, Some(body));
    assert_eq!(wire.receiver_stance(), v1::ReceiverStance::Any);
    assert_eq!(wire.improvement.unwrap().nanos, 2_000_000);
    assert_eq!((wire.object_scale, wire.object_mass_kg), (Some(1.25), Some(0.3)));
    assert_eq!(wire.constraints.unwrap().max_comfort_e, Some(0.25));
}
