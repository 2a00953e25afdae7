//! A request that is right, with one thing after the other made wrong.

mod numbers;

use glam::Vec3;
use grasp_proto::v1::{self, receiver::Body};

use numbers::NUMBERS;

use super::{
    find_query,
    testing::{
        duration, giver, half_space, held, object, present, thesis, tube, valid, vector, violations_of,
    },
};
use crate::rigs::store::RigStore;

type Request = v1::FindGraspRequest;

/// Makes something wrong.
type Change = fn(&mut Request);

const FINITE: &str = "every number must be finite";
const ABSENT: &str = "is absent; it is required";

const NAN: f32 = f32::NAN;

/// Fields, what is said of them, and what makes them wrong.
const CHANGES: &[(&str, &str, Change)] = &[
    ("holdout", ABSENT, |r| r.holdout = None),
    ("holdout.object", "is required: objects/ and", |r| object(r, "")),
    ("holdout.object", "is \"remote\"; it must be", |r| {
        object(r, "remote");
    }),
    ("holdout.object", "it must be objects/", |r| {
        object(r, "objects/../x");
    }),
    (
        "holdout.presenting_hand",
        "is empty; it must have a pose, joints or a mesh",
        |r| r.holdout_mut().presenting_hand = Some(v1::PresentingHand { form: None }),
    ),
    (
        "holdout.presenting_hand.pose.rig",
        "is \"rigs/robot\"; the built-in rigs are rigs/thesis and",
        |r| giver(r).rig = "rigs/robot".into(),
    ),
    (
        // Names are whole.
        "holdout.presenting_hand.pose.rig",
        "is \"adult\"",
        |r| giver(r).rig = "adult".into(),
    ),
    (
        "holdout.presenting_hand.pose.handedness",
        "is required: HANDEDNESS_LEFT or HANDEDNESS_RIGHT",
        |r| giver(r).handedness = 0,
    ),
    (
        "holdout.presenting_hand.pose.handedness",
        "is 7, which the contract does not define",
        |r| giver(r).handedness = 7,
    ),
    ("holdout.presenting_hand.pose.convention", "is 99, which", |r| {
        giver(r).convention = 99;
    }),
    (
        "holdout.presenting_hand.pose",
        "has neither client_from_wrist nor object_from_wrist",
        |r| giver(r).object_from_wrist = None,
    ),
    (
        "holdout.presenting_hand.pose.little",
        "is required; {} is the stretched digit",
        |r| giver(r).little = None,
    ),
    (
        "holdout.other_hands",
        "has 4 elements; it may have up to 3",
        |r| {
            let hand = r.holdout_mut().presenting_hand.clone().unwrap();
            r.holdout_mut().other_hands = vec![hand; 4];
        },
    ),
    ("holdout.other_hands[1].pose.rig", "is \"\"", |r| {
        let hand = r.holdout_mut().presenting_hand.clone().unwrap();
        giver(r).rig.clear();
        let wrong = r.holdout_mut().presenting_hand.replace(hand.clone()).unwrap();
        r.holdout_mut().other_hands = vec![hand, wrong];
    }),
    // Tubes count as their parts.
    (
        "holdout.obstacles",
        "has 80 elements; it may have up to 64",
        |r| {
            let tube = v1::Shape::tube([Vec3::ZERO; 17], 0.1);
            r.holdout_mut().obstacles = vec![tube; 5];
        },
    ),
    ("holdout.obstacles[0]", "is empty; it must have a tube", |r| {
        r.holdout_mut().obstacles[0].kind = None;
    }),
    ("holdout.obstacles[0].tube.points", "has 0 points", |r| {
        tube(r).points.clear();
    }),
    (
        "holdout.obstacles[0].tube.points",
        "has 65 points; it must have 1 to 64",
        |r| r.holdout_mut().obstacles = vec![v1::Shape::tube([Vec3::ZERO; 65], 0.1)],
    ),
    ("holdout.obstacles[0].tube.points[1]", FINITE, |r| {
        tube(r).points[1] = vector(NAN);
    }),
    (
        "holdout.obstacles[0].tube.radii",
        "has 0 elements; it must have one for all points",
        |r| tube(r).radii.clear(),
    ),
    (
        "holdout.obstacles[0].tube.radii",
        "has 3 elements; it must have one for all points, or one for each of the 2",
        |r| tube(r).radii = vec![0.1; 3],
    ),
    ("holdout.obstacles[0].tube.radii", "has 65 elements", |r| {
        tube(r).radii = vec![0.1; 65];
    }),
    ("holdout.obstacles[2].half_space.normal", ABSENT, |r| {
        half_space(r).normal = None;
    }),
    ("receiver.rig", "is \"adult\"", |r| {
        r.receiver_mut().rig = "adult".into();
        r.current = None;
    }),
    ("receiver.handedness", "is 3, which", |r| {
        r.receiver_mut().handedness = 3;
    }),
    (
        "receiver.handedness",
        "is unspecified with client_shoulder, which is one side's",
        |r| r.receiver_mut().handedness = 0,
    ),
    ("receiver.max_reach", "is set without a shoulder", |r| {
        r.receiver_mut().body = None;
    }),
    ("receiver.max_reach", "is set without a shoulder", |r| {
        r.receiver_mut().body = Some(Body::Anywhere(true));
    }),
    (
        "requirements.client_approach",
        "is required with max_approach_angle",
        |r| r.requirements_mut().client_approach = None,
    ),
    (
        "requirements.allowed_grasp_types[1]",
        "is GRASP_TYPE_UNSPECIFIED; it must name a type",
        |r| r.requirements_mut().allowed_grasp_types = vec![14, 0],
    ),
    ("requirements.allowed_grasp_types[0]", "is 34, which", |r| {
        r.requirements_mut().allowed_grasp_types = vec![34];
    }),
    (
        "requirements.excluded_grasp_types[1]",
        "which allowed_grasp_types contains as well",
        |r| {
            r.requirements_mut().allowed_grasp_types = vec![14];
            r.requirements_mut().excluded_grasp_types = vec![15, 14];
        },
    ),
    (
        "requirements.excluded_grasp_types",
        "lists all 33 types; at least one must be allowed",
        |r| r.requirements_mut().excluded_grasp_types = (1..=33).collect(),
    ),
    (
        "requirements.must_touch[0]",
        "is DIGIT_UNSPECIFIED; it must name a digit",
        |r| r.requirements_mut().must_touch = vec![0],
    ),
    ("requirements.must_touch[1]", "is 9, which", |r| {
        r.requirements_mut().must_touch = vec![1, 9];
    }),
    (
        "requirements.must_not_touch[0]",
        "is Thumb, which must_touch contains as well",
        |r| {
            r.requirements_mut().must_touch = vec![1];
            r.requirements_mut().must_not_touch = vec![1];
        },
    ),
    ("requirements.thesis.strategy", "is 99, which", |r| {
        thesis(r).strategy = 99;
        r.current = None;
    }),
    ("requirements.thesis.bend_ratios", "is -1, which", |r| {
        thesis(r).bend_ratios = -1;
    }),
    ("search.choice", "is 4, which", |r| r.search_mut().choice = 4),
    ("search.budget", "is 0 s and 0 ns; it must be more than 0", |r| {
        r.search_mut().budget = Some(duration(0, 0));
    }),
    (
        "search.budget",
        "is -1 s and 0 ns; it must not be negative",
        |r| r.search_mut().budget = Some(duration(-1, 0)),
    ),
    ("search.budget", "is 1 s and -1 ns, which is not a valid", |r| {
        r.search_mut().budget = Some(duration(1, -1));
    }),
    ("search.budget", "is 0 s and 2000000000 ns, which", |r| {
        r.search_mut().budget = Some(duration(0, 2_000_000_000));
    }),
    ("search.budget", "which is not a valid", |r| {
        r.search_mut().budget = Some(duration(i64::MIN, i32::MIN));
    }),
    (
        "search.refinement_time",
        "is -1 s and 0 ns; it must not be negative",
        |r| r.search_mut().refinement_time = Some(duration(-1, 0)),
    ),
    ("search.max_attempts", "is 0; it must be at least 1", |r| {
        r.search_mut().max_attempts = Some(0);
    }),
    (
        "search.replay_attempt",
        "it must be at most 4611686018427387903",
        |r| {
            r.search_mut().replay_attempt = Some(u64::MAX);
            r.current = None;
        },
    ),
    ("output.convention", "is 99, which", |r| {
        r.output_mut().convention = 99;
    }),
    ("current.grasp", "is required: the grasp to hold on to", |r| {
        r.current.as_mut().unwrap().grasp = None;
    }),
    (
        "current.grasp.rig",
        "is \"rigs/thesis\"; it must be \"rigs/adult\", the receiver's",
        |r| held(r).rig = "rigs/thesis".into(),
    ),
    (
        "current.grasp.scale",
        "is 1.2; it must be 1, the receiver's",
        |r| held(r).scale = Some(1.2),
    ),
    (
        "current.grasp.handedness",
        "is the other hand than receiver.handedness",
        |r| held(r).handedness = v1::Handedness::Left.into(),
    ),
    ("current.grasp.scale", "it must be 0.5 to 2", |r| {
        held(r).scale = Some(9.0);
    }),
    ("current.grasp", "has neither client_from_wrist", |r| {
        held(r).object_from_wrist = None;
    }),
    ("current.hand", "has neither client_from_wrist", |r| {
        present(r).object_from_wrist = None;
    }),
    ("current.hand.rig", "is \"\"; the built-in rigs", |r| {
        present(r).rig.clear();
    }),
    (
        "current.hand.handedness",
        "is not that of current.grasp; it must be the same hand",
        |r| {
            present(r).handedness = v1::Handedness::Left.into();
            r.receiver = None;
        },
    ),
    (
        "current",
        "is set with thesis_validity or a strategy of the thesis",
        |r| thesis(r).strategy = v1::Strategy::F.into(),
    ),
    ("current", "cannot be combined with replay_attempt", |r| {
        r.search_mut().replay_attempt = Some(3);
    }),
];

/// The fields that are blamed, and what is said of them.
fn blamed(request: Request, exists: bool) -> Vec<(String, String)> {
    let rigs = RigStore::new(1, None);
    violations_of(find_query(request, ("rigs/adult", &rigs), |_| exists))
}

#[test]
fn every_field_of_a_search_is_checked() {
    assert_eq!(blamed(valid(), true), []);
    let with_numbers = NUMBERS.iter().flat_map(|(field, text, numbers, set)| {
        numbers.iter().map(move |&number| {
            let mut request = valid();
            set(&mut request, number);
            (*field, *text, request)
        })
    });
    let changed = CHANGES.iter().map(|(field, text, change)| {
        let mut request = valid();
        change(&mut request);
        (*field, *text, request)
    });
    let mut missed = Vec::new();
    for (field, text, request) in with_numbers.chain(changed) {
        let blamed = blamed(request, true);
        match &blamed[..] {
            [(of, said)] if of == field && said.contains(text) => {}
            _ => missed.push(format!("{field} {text}: {blamed:?}")),
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
fn everything_that_is_wrong_is_said_at_once() {
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
    let blamed_fields: Vec<String> = blamed(request, false)
        .into_iter()
        .map(|(field, _)| field)
        .collect();
    assert_eq!(blamed_fields, fields);
    // Alone, it is left to the look-up.
    assert_eq!(blamed(valid(), false), []);
}
