//! Whole requests, part by part.

mod fields;

use super::*;
use crate::validate::{
    evaluate_query, fixtures::stretched_hand, stream_query, testing::blamed, validate_query,
};

fn rigs() -> RigStore {
    RigStore::new(1, None)
}

fn find(request: v1::FindGraspRequest) -> Result<FindQuery, ServiceError> {
    find_query(request, ("rigs/adult", &rigs()), |_| true)
}

fn holdout() -> v1::Holdout {
    v1::Holdout {
        object: "objects/remote".to_owned(),
        ..Default::default()
    }
}

/// A right hand at the object.
fn a_hand(object_from_wrist: v1::Pose) -> v1::HandPose {
    v1::HandPose {
        object_from_wrist: Some(object_from_wrist),
        ..stretched_hand(v1::Handedness::Right)
    }
}

/// Requirements that only experiments have.
fn experiment() -> v1::Requirements {
    v1::Requirements {
        thesis: Some(v1::ThesisOptions {
            thesis_validity: true,
            strategy: v1::Strategy::A.into(),
            bend_ratios: v1::BendRatios::All.into(),
            record_step_times: true,
            max_comfort: Some(0.1),
        }),
        ..Default::default()
    }
}

const EXPERIMENT: [&str; 4] = [
    "requirements.thesis.thesis_validity",
    "requirements.thesis.strategy",
    "requirements.thesis.bend_ratios",
    "requirements.thesis.record_step_times",
];

fn both_hands() -> v1::Receiver {
    v1::Receiver {
        both_hands: true,
        ..Default::default()
    }
}

#[test]
fn thesis_and_both_hands_exclude_what_they_do_not_know() {
    let request = v1::FindGraspRequest {
        holdout: Some(v1::Holdout {
            other_hands: vec![a_hand(v1::Pose::default()).into()],
            obstacles: vec![v1::Shape::ball(Vec3::ZERO, 0.1)],
            ..holdout()
        }),
        receiver: Some(both_hands()),
        requirements: Some(experiment()),
        output: Some(v1::OutputOptions {
            key_frames: true,
            ..Default::default()
        }),
        current: Some(v1::CurrentGrasp {
            // Of another rig than the thesis'.
            grasp: Some(a_hand(v1::Pose::default())),
            ..Default::default()
        }),
        ..Default::default()
    };
    let fields = [
        "holdout.other_hands",
        "holdout.obstacles",
        "receiver.both_hands",
        "output.key_frames",
        "current",
        "current",
        "current.grasp.rig",
    ];
    assert_eq!(blamed(find(request)), fields);
    let replay = v1::FindGraspRequest {
        holdout: Some(holdout()),
        search: Some(v1::SearchOptions {
            replay_attempt: Some(3),
            ..Default::default()
        }),
        ..Default::default()
    };
    let answer = find(replay);
    assert_eq!(blamed(answer), ["receiver.handedness"]);
}

#[test]
fn choices_keep_their_meaning() {
    use v1::GraspChoice as C;
    for (choice, expected) in [
        (C::Unspecified, (Choice::FirstValid, false, false)),
        (C::FirstValid, (Choice::FirstValid, false, false)),
        (C::BestWithinBudget, (Choice::BestWithinBudget, false, true)),
        (C::Reproducible, (Choice::FirstValid, true, false)),
    ] {
        let request = v1::FindGraspRequest {
            holdout: Some(holdout()),
            search: Some(v1::SearchOptions {
                choice: choice.into(),
                ..Default::default()
            }),
            ..Default::default()
        };
        let query = find(request).expect("it is right");
        let found = (query.choice, query.reproducible, query.limits.is_patient);
        assert_eq!(found, expected, "{choice:?}");
        assert!(query.allows_atlas && !query.is_replay && !query.changes_only);
    }
}

#[test]
fn streams_evaluations_and_validations_refuse_what_they_cannot_do() {
    let rigs = rigs();
    let rigs = ("rigs/adult", &rigs);
    let search = v1::SearchOptions {
        choice: v1::GraspChoice::Reproducible.into(),
        replay_attempt: Some(1),
        ..Default::default()
    };
    let stream = v1::StreamGraspsRequest {
        holdout: Some(holdout()),
        receiver: Some(both_hands()),
        search: Some(search),
        sent: Some(v1::stream_grasps_request::Sent::MaxRateHz(0.0)),
        ..Default::default()
    };
    let fields = [
        "max_rate_hz",
        "search.choice",
        "search.replay_attempt",
        "receiver.both_hands",
    ];
    assert_eq!(blamed(stream_query(stream, rigs, |_| true)), fields);
    let evaluation = v1::EvaluateHoldoutRequest {
        holdout: Some(holdout()),
        receiver: Some(both_hands()),
        requirements: Some(experiment()),
        search: Some(search),
        output: Some(v1::OutputOptions {
            key_frames: true,
            ..Default::default()
        }),
        other_presenting_hands: vec![v1::PresentingHand { form: None }],
    };
    let mut fields = blamed(evaluate_query(evaluation, rigs, |_| true));
    fields.dedup();
    let mut expected = vec!["other_presenting_hands[0]", "receiver.both_hands"];
    expected.extend(EXPERIMENT);
    expected.extend(["search.replay_attempt", "output.key_frames"]);
    expected.push("receiver.both_hands");
    assert_eq!(fields, expected);
    let validation = v1::ValidateGraspRequest {
        receiver: Some(both_hands()),
        nearest_budget: Some(prost_types::Duration::default()),
        ..Default::default()
    };
    let fields = ["grasp", "nearest_budget", "receiver.both_hands", "holdout"];
    assert_eq!(blamed(validate_query(validation, rigs, |_| true)), fields);
}

#[test]
fn a_grasp_to_validate_names_the_receiver() {
    use v1::validate_grasp_request::Grasp;
    let rigs = rigs();
    let rigs = ("rigs/thesis", &rigs);
    let grasp = v1::HandPose {
        scale: Some(1.2),
        ..a_hand(v1::Pose::default())
    };
    let request = |receiver| v1::ValidateGraspRequest {
        holdout: Some(holdout()),
        receiver,
        grasp: Some(Grasp::Pose(grasp.clone())),
        ..Default::default()
    };
    let query = validate_query(request(None), rigs, |_| true).expect("it is right");
    let hand = &query.holdout.receiving_hand;
    assert_eq!((hand.hand.rig.name.as_str(), hand.scale), ("adult", 1.2));
    assert!(query.holdout.alternative_hand.is_none() && !query.find_nearest);
    let contradicting = v1::Receiver {
        rig: "rigs/thesis".to_owned(),
        handedness: v1::Handedness::Left.into(),
        scale: Some(0.9),
        ..Default::default()
    };
    let fields = ["receiver.handedness", "receiver.rig", "receiver.scale"];
    let answer = validate_query(request(Some(contradicting)), rigs, |_| true);
    assert_eq!(blamed(answer), fields);
}
