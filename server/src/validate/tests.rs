//! Valid requests, made wrong in one field after the other.

pub(crate) mod fixtures;

use glam::{Quat, Vec3};
use grasp_proto::v1::{self, presenting_hand::Form, receiver::Body, shape::Kind};
use grasp_synthesis::model::strategy::Choice;

use super::{
    FindQuery, evaluate_query, find_query,
    fixtures::{Change, SetNumber, assert_blamed, blamed, stretched_hand, table, violations_of},
    stream_query, validate_query,
};
use crate::{error::ServiceError, rigs::store::RigStore};

type Request = v1::FindGraspRequest;

const FINITE: &str = "every number must be finite";
const ABSENT: &str = "is absent; it is required";
const SIZE: &str = "it must be more than 0 and at most 1000";
const NEAR: &str = "no coordinate may be more than 1000 from 0 (1 km)";
const NOT_ZERO: &str = "it must be finite and not 0";
const UNIT: &str = "it must be a unit quaternion, within 1 %";
const DISTANCE: &str = "it must be within 3 (3 m)";
const BONE: &str = "it must be 0.1 to 0.6 (0.1 to 0.6 m)";
const SCALE: &str = "it must be 0.5 to 2";
const NO_WRIST: &str = "has neither client_from_wrist nor object_from_wrist";
const NAN: f32 = f32::NAN;
const INF: f32 = f32::INFINITY;
const NUMBERS: &[SetNumber<Request>] = table! {
    "holdout.scale", "it must be 0.25 to 4", [0.0, -1.0, 0.24, 4.01, NAN, INF]
        => |r, x| r.holdout_mut().scale = Some(x);
    "holdout.mass_kg", "and at most 1000", [0.0, -1.0, 1001.0, NAN, INF]
        => |r, x| r.holdout_mut().mass_kg = Some(x);
    "holdout.up", NOT_ZERO, [0.0, NAN, INF] => |r, x| r.holdout_mut().up = Some(vector(x));
    "holdout.client_from_object.orientation", UNIT, [0.0, 0.98, 1.02, NAN, INF, 1e30]
        => |r, x| object_at(r, turned(x));
    "holdout.client_from_object.position", FINITE, [NAN, INF] => |r, x| object_at(r, placed(x));
    "holdout.client_from_object.position", NEAR, [1e6, -1001.0] => |r, x| object_at(r, placed(x));
    "holdout.presenting_hand.pose.scale", SCALE, [0.49, 2.01, NAN] => |r, x| giver(r).scale = Some(x);
    "holdout.presenting_hand.pose.object_from_wrist.orientation", UNIT, [0.0, NAN]
        => |r, x| giver(r).object_from_wrist = Some(turned(x));
    "holdout.presenting_hand.pose.index.base_pitch", "the rig allows", [4.0, -4.0, NAN]
        => |r, x| giver(r).index.as_mut().unwrap().base_pitch = x;
    "holdout.presenting_hand.pose.little.third_pitch", "the rig allows", [9.0, NAN]
        => |r, x| giver(r).little.as_mut().unwrap().third_pitch = Some(x);
    "holdout.obstacles[0].tube.radii[0]", SIZE, [0.0, -0.1, 1001.0, NAN] => |r, x| tube(r).radii = vec![x];
    "holdout.obstacles[1].box.half_extents", SIZE, [0.0, -1.0, 1001.0] => half_extent;
    "holdout.obstacles[1].box.half_extents", FINITE, [NAN, INF] => half_extent;
    "holdout.obstacles[2].half_space.normal", NOT_ZERO, [0.0, NAN]
        => |r, x| half_space(r).normal = Some(vector(x));
    "holdout.obstacles[2].half_space.point", NEAR, [1e6] => |r, x| half_space(r).point = Some(vector(x));
    "receiver.scale", SCALE, [0.49, 2.01, NAN] => |r, x| r.receiver_mut().scale = Some(x);
    "receiver.max_reach", SIZE, [0.0, -0.7, NAN, INF]
        => |r, x| r.receiver_mut().max_reach = Some(x);
    "receiver.upper_arm_length", BONE, [0.09, 0.61, -0.3, NAN]
        => |r, x| r.receiver_mut().upper_arm_length = Some(x);
    "receiver.forearm_length", BONE, [0.09, 0.61, INF] => |r, x| r.receiver_mut().forearm_length = Some(x);
    "receiver.height", "it must be 0.8 to 2.5 (0.8 to 2.5 m)", [0.0, 0.79, 2.51, NAN]
        => |r, x| standing(r, v1::Pose::default(), x);
    "receiver.client_from_root.orientation", UNIT, [0.5, NAN] => |r, x| standing(r, turned(x), 1.7);
    "receiver.client_from_root.position", FINITE, [NAN, INF] => |r, x| standing(r, placed(x), 1.7);
    "receiver.client_from_root", DISTANCE, [4.0] => |r, x| standing(r, placed(x), 1.7);
    "receiver.client_shoulder", FINITE, [NAN] => shoulder;
    "receiver.client_shoulder", NEAR, [1e6] => shoulder;
    "receiver.client_shoulder", DISTANCE, [3.1, -99.0] => shoulder;
    "requirements.friction", "and at most 5", [0.0, -1.0, 50.0, NAN]
        => |r, x| r.requirements_mut().friction = Some(x);
    "requirements.max_approach_angle", "it must be more than 0 and at most 3.14", [0.0, -0.1, 3.2, NAN]
        => |r, x| r.requirements_mut().max_approach_angle = x;
    "requirements.client_approach", NOT_ZERO, [0.0, NAN]
        => |r, x| r.requirements_mut().client_approach = Some(vector(x));
    "requirements.thesis.max_comfort", "it must be finite and at least 0", [-1.0, NAN, INF]
        => |r, x| thesis(r).max_comfort = Some(x);
    "current.min_score_gain", "it must be 0 to 1", [-0.1, 1.1, NAN]
        => |r, x| r.current.as_mut().unwrap().min_score_gain = Some(x);
};

const CHANGES: &[Change<Request>] = table! {
    "holdout", ABSENT => |r| r.holdout = None;
    "holdout.object", "is required: objects/ and" => |r| r.holdout_mut().object.clear();
    "holdout.object", "is \"remote\"; it must be" => |r| r.holdout_mut().object = "remote".into();
    "holdout.presenting_hand", "is empty; it must have a pose, joints or a mesh"
        => |r| r.holdout_mut().presenting_hand = Some(v1::PresentingHand { form: None });
    "holdout.presenting_hand.pose.rig", "is \"rigs/robot\"; the built-in rigs are rigs/thesis and"
        => |r| giver(r).rig = "rigs/robot".into();
    "holdout.presenting_hand.pose.rig", "is \"adult\"" => |r| giver(r).rig = "adult".into();
    "holdout.presenting_hand.pose.handedness", "is required: HANDEDNESS_LEFT or"
        => |r| giver(r).handedness = 0;
    "holdout.presenting_hand.pose.handedness", "is 7, which the contract does not define"
        => |r| giver(r).handedness = 7;
    "holdout.presenting_hand.pose.convention", "is 99, which" => |r| giver(r).convention = 99;
    "holdout.presenting_hand.pose", NO_WRIST => |r| giver(r).object_from_wrist = None;
    "holdout.presenting_hand.pose.little", "is required; {} is the stretched digit"
        => |r| giver(r).little = None;
    "holdout.other_hands", "has 4 elements; it may have up to 3" => |r| other_hands(r, 4);
    "holdout.other_hands[1].pose.rig", "is \"\"" => |r| {
        other_hands(r, 2);
        let Some(Form::Pose(hand)) = &mut r.holdout_mut().other_hands[1].form else { panic!("it is posed") };
        hand.rig.clear();
    };
    "holdout.obstacles", "has 80 elements; it may have up to 64" => |r| obstacle_of(r, 17, 5);
    "holdout.obstacles[0]", "is empty; it must have a tube" => |r| r.holdout_mut().obstacles[0].kind = None;
    "holdout.obstacles[0].tube.points", "has 0 points" => |r| tube(r).points.clear();
    "holdout.obstacles[0].tube.points", "has 65 points; it must have 1 to 64" => |r| obstacle_of(r, 65, 1);
    "holdout.obstacles[0].tube.points[1]", FINITE => |r| tube(r).points[1] = vector(NAN);
    "holdout.obstacles[0].tube.radii", "has 0 elements; it must have one for all"
        => |r| tube(r).radii.clear();
    "holdout.obstacles[0].tube.radii", "has 3 elements; it must have one for all points, or one for each of the 2"
        => |r| tube(r).radii = vec![0.1; 3];
    "holdout.obstacles[0].tube.radii", "has 65 elements" => |r| tube(r).radii = vec![0.1; 65];
    "holdout.obstacles[2].half_space.normal", ABSENT => |r| half_space(r).normal = None;
    "receiver.rig", "is \"adult\"" => |r| { r.receiver_mut().rig = "adult".into(); r.current = None; };
    "receiver.handedness", "is 3, which" => |r| r.receiver_mut().handedness = 3;
    "receiver.handedness", "is unspecified with client_shoulder, which"
        => |r| r.receiver_mut().handedness = 0;
    "receiver.max_reach", "is set without a shoulder"
        => |r| r.receiver_mut().body = Some(Body::Anywhere(true));
    "requirements.client_approach", "is required with max_approach_angle"
        => |r| r.requirements_mut().client_approach = None;
    "requirements.allowed_grasp_types[1]", "is GRASP_TYPE_UNSPECIFIED; it must name a type"
        => |r| r.requirements_mut().allowed_grasp_types = vec![14, 0];
    "requirements.allowed_grasp_types[0]", "is 34, which"
        => |r| r.requirements_mut().allowed_grasp_types = vec![34];
    "requirements.excluded_grasp_types[1]", "which allowed_grasp_types contains as well" => |r| {
        r.requirements_mut().allowed_grasp_types = vec![14];
        r.requirements_mut().excluded_grasp_types = vec![15, 14];
    };
    "requirements.excluded_grasp_types", "lists all 33 types; at least one must be allowed"
        => |r| r.requirements_mut().excluded_grasp_types = (1..=33).collect();
    "requirements.must_touch[0]", "is DIGIT_UNSPECIFIED; it must name"
        => |r| r.requirements_mut().must_touch = vec![0];
    "requirements.must_touch[1]", "is 9, which" => |r| r.requirements_mut().must_touch = vec![1, 9];
    "requirements.must_not_touch[0]", "is Thumb, which must_touch contains as well" => |r| {
        r.requirements_mut().must_touch = vec![1];
        r.requirements_mut().must_not_touch = vec![1];
    };
    "requirements.thesis.strategy", "is 99, which" => |r| { thesis(r).strategy = 99; r.current = None; };
    "requirements.thesis.bend_ratios", "is -1, which" => |r| thesis(r).bend_ratios = -1;
    "search.choice", "is 4, which" => |r| r.search_mut().choice = 4;
    "search.budget", "is 0 s and 0 ns; it must be more than 0" => |r| budget(r, 0, 0);
    "search.budget", "is -1 s and 0 ns; it must not be negative" => |r| budget(r, -1, 0);
    "search.budget", "is 1 s and -1 ns, which is not a valid" => |r| budget(r, 1, -1);
    "search.budget", "is 0 s and 2000000000 ns, which" => |r| budget(r, 0, 2_000_000_000);
    "search.budget", "which is not a valid" => |r| budget(r, i64::MIN, i32::MIN);
    "search.refinement_time", "is -1 s and 0 ns; it must not be negative"
        => |r| r.search_mut().refinement_time = Some(prost_types::Duration { seconds: -1, nanos: 0 });
    "search.max_attempts", "is 0; it must be at least 1" => |r| r.search_mut().max_attempts = Some(0);
    "search.replay_attempt", "it must be 0 to 4611686018427387903"
        => |r| { r.search_mut().replay_attempt = Some(u64::MAX); r.current = None; };
    "output.convention", "is 99, which" => |r| r.output_mut().convention = 99;
    "current.grasp", "is required: the grasp to hold on to" => |r| r.current.as_mut().unwrap().grasp = None;
    "current.grasp.rig", "is \"rigs/thesis\"; it must be \"rigs/adult\", the receiver's"
        => |r| held(r).rig = "rigs/thesis".into();
    "current.grasp.scale", "is 1.2; it must be 1, the receiver's" => |r| held(r).scale = Some(1.2);
    "current.grasp.handedness", "is the other hand than receiver.handedness"
        => |r| held(r).set_handedness(v1::Handedness::Left);
    "current.grasp.scale", SCALE => |r| held(r).scale = Some(9.0);
    "current.grasp", NO_WRIST => |r| held(r).object_from_wrist = None;
    "current.hand", NO_WRIST => |r| present(r).object_from_wrist = None;
    "current.hand.rig", "is \"\"; the built-in rigs" => |r| present(r).rig.clear();
    "current.hand.handedness", "is not that of current.grasp; it must be the same hand"
        => |r| { present(r).set_handedness(v1::Handedness::Left); r.receiver = None; };
    "current", "is set with thesis_validity or a strategy of the thesis"
        => |r| thesis(r).strategy = v1::Strategy::F.into();
    "current", "cannot be combined with replay_attempt" => |r| r.search_mut().replay_attempt = Some(3);
};

fn vector(x: f32) -> v1::Vector3 {
    (Vec3::X * x).into()
}

fn placed(x: f32) -> v1::Pose {
    v1::Pose {
        position: Some(vector(x)),
        orientation: None,
    }
}

fn turned(w: f32) -> v1::Pose {
    v1::Pose {
        position: None,
        orientation: Some(v1::Quaternion {
            w,
            ..Default::default()
        }),
    }
}

fn budget(request: &mut Request, seconds: i64, nanos: i32) {
    request.search_mut().budget = Some(prost_types::Duration { seconds, nanos });
}

fn object_at(request: &mut Request, client_from_object: v1::Pose) {
    request.holdout_mut().client_from_object = Some(client_from_object);
}

fn other_hands(request: &mut Request, count: usize) {
    let hand = request.holdout_mut().presenting_hand.clone().unwrap();
    request.holdout_mut().other_hands = vec![hand; count];
}

/// Some tubes of this many points.
fn obstacle_of(request: &mut Request, points: usize, tubes: usize) {
    let tube = v1::Shape::tube(vec![Vec3::ZERO; points], 0.1);
    request.holdout_mut().obstacles = vec![tube; tubes];
}

fn giver(request: &mut Request) -> &mut v1::HandPose {
    match &mut request.holdout_mut().presenting_hand {
        Some(v1::PresentingHand {
            form: Some(Form::Pose(hand)),
        }) => hand,
        _ => panic!("the hand is posed"),
    }
}

fn held(request: &mut Request) -> &mut v1::HandPose {
    request.current.as_mut().unwrap().grasp.as_mut().unwrap()
}

/// The hand as it is now, where the grasp is unless it is changed.
fn present(request: &mut Request) -> &mut v1::HandPose {
    let current = request.current.as_mut().unwrap();
    current.hand.get_or_insert_with(|| current.grasp.clone().unwrap())
}

fn tube(request: &mut Request) -> &mut v1::TubeShape {
    match request.holdout_mut().obstacles[0].kind.as_mut() {
        Some(Kind::Tube(tube)) => tube,
        _ => panic!("the first is a tube"),
    }
}

fn half_extent(request: &mut Request, x: f32) {
    request.holdout_mut().obstacles[1] = v1::Shape::solid_box(v1::Pose::default(), Vec3::new(1.0, x, 1.0));
}

fn half_space(request: &mut Request) -> &mut v1::HalfSpaceShape {
    match request.holdout_mut().obstacles[2].kind.as_mut() {
        Some(Kind::HalfSpace(half_space)) => half_space,
        _ => panic!("the third is a half-space"),
    }
}

fn shoulder(request: &mut Request, x: f32) {
    request.receiver_mut().body = Some(Body::ClientShoulder(vector(x)));
}

fn standing(request: &mut Request, root: v1::Pose, height: f32) {
    request.receiver_mut().body = Some(Body::ClientFromRoot(root));
    request.receiver_mut().height = height;
}

fn thesis(request: &mut Request) -> &mut v1::ThesisOptions {
    request.requirements_mut().thesis.get_or_insert_default()
}

fn valid() -> Request {
    let wrist = v1::Pose::new(Vec3::new(0.0, 0.1, 0.2), Quat::IDENTITY);
    let hand = |side| stretched_hand(side).with_object_from_wrist(wrist);
    Request {
        receiver: Some(v1::Receiver {
            handedness: v1::Handedness::Right.into(),
            upper_arm_length: Some(0.3),
            max_reach: Some(0.7),
            ..v1::Receiver::with_shoulder(Vec3::new(0.1, 1.2, 0.0))
        }),
        requirements: Some(v1::Requirements {
            client_approach: Some(vector(1.0)),
            max_approach_angle: 0.4,
            ..Default::default()
        }),
        ..Request::new("objects/remote")
    }
    .with_presenting_hand(hand(v1::Handedness::Left))
    .with_obstacle(v1::Shape::capsule(Vec3::ZERO, Vec3::X, 0.1))
    .with_obstacle(v1::Shape::solid_box(v1::Pose::default(), Vec3::ONE))
    .with_obstacle(v1::Shape::half_space(Vec3::ZERO, Vec3::Y))
    .with_current(v1::CurrentGrasp::new(hand(v1::Handedness::Right)))
}

fn find(request: Request, exists: bool) -> Result<FindQuery, ServiceError> {
    find_query(request, ("rigs/adult", &RigStore::new(1, None)), |_| exists)
}

#[test]
fn every_field_of_a_search_is_checked() {
    assert_eq!(blamed(find(valid(), true)), [""; 0]);
    assert_blamed(&valid(), NUMBERS, CHANGES, |request| {
        violations_of(find(request, true))
    });
}

#[test]
fn all_violations_are_reported_at_once() {
    let mut request = valid();
    request.output_mut().convention = 99;
    request.holdout_mut().scale = Some(9.0);
    giver(&mut request).handedness = 9;
    half_space(&mut request).normal = None;
    request.receiver_mut().rig = "adult".to_owned();
    request.requirements_mut().friction = Some(-1.0);
    request.search_mut().choice = 9;
    request.current.as_mut().unwrap().min_score_gain = Some(2.0);
    let fields = [
        "output.convention",
        "holdout.scale",
        "holdout.presenting_hand.pose.handedness",
        "holdout.obstacles[2].half_space.normal",
        "receiver.rig",
        "requirements.friction",
        "search.choice",
        "current.min_score_gain",
        // An unknown object among other violations is one of them.
        "holdout.object",
    ];
    assert_eq!(blamed(find(request, false)), fields);
    // Alone, it is left to the look-up.
    assert_eq!(blamed(find(valid(), false)), [""; 0]);
}

fn a_hand() -> v1::HandPose {
    stretched_hand(v1::Handedness::Right).with_object_from_wrist(v1::Pose::default())
}

/// A search with every option that only `FindGrasp`, or only a search for a first grasp, supports.
fn experiment() -> Request {
    let mut request = Request::new("objects/remote").with_key_frames();
    *thesis(&mut request) = v1::ThesisOptions {
        thesis_validity: true,
        strategy: v1::Strategy::A.into(),
        bend_ratios: v1::BendRatios::All.into(),
        record_step_times: true,
        max_comfort: Some(0.1),
    };
    request.receiver_mut().both_hands = true;
    request
}

#[test]
fn thesis_and_both_hands_exclude_unsupported_fields() {
    let mut request = experiment().with_obstacle(v1::Shape::ball(Vec3::ZERO, 0.1));
    request.holdout_mut().other_hands = vec![a_hand().into()];
    // Of another rig than the thesis'.
    request.current = Some(v1::CurrentGrasp::new(a_hand()));
    let fields = [
        "holdout.other_hands",
        "holdout.obstacles",
        "receiver.both_hands",
        "output.key_frames",
        "current",
        "current",
        "current.grasp.rig",
    ];
    assert_eq!(blamed(find(request, true)), fields);
    let mut replay = Request::new("objects/remote");
    replay.search_mut().replay_attempt = Some(3);
    assert_eq!(blamed(find(replay, true)), ["receiver.handedness"]);
}

#[test]
fn a_current_grasp_may_be_of_either_hand_if_the_search_chooses() {
    let mut left = Request::new("objects/remote").with_current(v1::CurrentGrasp::new(a_hand()));
    held(&mut left).set_handedness(v1::Handedness::Left);
    present(&mut left);
    assert_eq!(blamed(find(left, true)), [""; 0]);
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
        let mut request = Request::new("objects/remote");
        request.search_mut().set_choice(choice);
        let query = find(request, true).expect("it is right");
        let found = (
            query.search.choice,
            query.run.reproducible,
            query.limits.is_patient,
        );
        assert_eq!(found, expected, "{choice:?}");
        assert!(query.allows_atlas && !query.is_replay && !query.changes_only);
    }
}

#[test]
fn streams_evaluations_and_validations_refuse_unsupported_fields() {
    let rigs = ("rigs/adult", &RigStore::new(1, None));
    let mut request = experiment();
    request.search_mut().set_choice(v1::GraspChoice::Reproducible);
    request.search_mut().replay_attempt = Some(1);
    let stream = v1::StreamGraspsRequest {
        sent: Some(v1::stream_grasps_request::Sent::MaxRateHz(0.0)),
        requirements: None,
        output: None,
        ..v1::StreamGraspsRequest::from(request.clone())
    };
    let fields = [
        "max_rate_hz",
        "search.choice",
        "search.replay_attempt",
        "receiver.both_hands",
    ];
    assert_eq!(blamed(stream_query(stream, rigs, |_| true)), fields);
    let evaluation = v1::EvaluateHoldoutRequest {
        other_presenting_hands: vec![v1::PresentingHand::default()],
        ..request.clone().into()
    };
    let mut fields = blamed(evaluate_query(evaluation, rigs, |_| true));
    fields.dedup();
    let expected = [
        "other_presenting_hands[0]",
        "receiver.both_hands",
        "requirements.thesis.thesis_validity",
        "requirements.thesis.strategy",
        "requirements.thesis.bend_ratios",
        "requirements.thesis.record_step_times",
        "search.replay_attempt",
        "output.key_frames",
        "receiver.both_hands",
    ];
    assert_eq!(fields, expected);
    let validation = v1::ValidateGraspRequest {
        receiver: request.receiver,
        nearest_budget: Some(prost_types::Duration::default()),
        ..Default::default()
    };
    let fields = ["grasp", "nearest_budget", "receiver.both_hands", "holdout"];
    assert_eq!(blamed(validate_query(validation, rigs, |_| true)), fields);
}

#[test]
fn a_grasp_to_validate_names_the_receiver() {
    let rigs = ("rigs/thesis", &RigStore::new(1, None));
    let grasp = v1::HandPose {
        scale: Some(1.2),
        ..a_hand()
    };
    let request = |receiver| v1::ValidateGraspRequest {
        receiver,
        ..v1::ValidateGraspRequest::new("objects/remote").with_pose(grasp.clone())
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
