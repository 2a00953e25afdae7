//! One wrong field at a time.

use super::*;

type Mutation = fn(&mut v1::FindGraspRequest);

fn search(request: &mut v1::FindGraspRequest) -> &mut v1::SearchOptions {
    request.search.get_or_insert_default()
}

fn requirements(request: &mut v1::FindGraspRequest) -> &mut v1::Requirements {
    request.requirements.get_or_insert_default()
}

fn thesis(request: &mut v1::FindGraspRequest) -> &mut v1::ThesisOptions {
    requirements(request).thesis.get_or_insert_default()
}

fn current(request: &mut v1::FindGraspRequest) -> &mut v1::CurrentGrasp {
    request.current.as_mut().expect("it has one")
}

/// The grasp to hold on to.
fn grasp(request: &mut v1::FindGraspRequest) -> &mut v1::HandPose {
    current(request).grasp.as_mut().expect("it has one")
}

/// The hand as it is now.
fn hand(request: &mut v1::FindGraspRequest) -> &mut v1::HandPose {
    current(request).hand.as_mut().expect("it has one")
}

/// A right request of a right hand.
fn right_handed() -> v1::FindGraspRequest {
    v1::FindGraspRequest {
        holdout: Some(holdout()),
        receiver: Some(v1::Receiver {
            handedness: v1::Handedness::Right.into(),
            ..Default::default()
        }),
        ..Default::default()
    }
}

/// A right request to hold on to a grasp.
fn holding() -> v1::FindGraspRequest {
    let hand = a_hand(v1::Pose::default());
    v1::FindGraspRequest {
        current: Some(v1::CurrentGrasp {
            grasp: Some(hand.clone()),
            hand: Some(hand),
            min_score_gain: Some(0.1),
            committed: false,
        }),
        ..right_handed()
    }
}

fn assert_each_blamed(base: fn() -> v1::FindGraspRequest, table: &[(Mutation, &[&str])]) {
    assert!(blamed(find(base())).is_empty(), "the unchanged request is right");
    for (row, (mutate, fields)) in table.iter().enumerate() {
        let mut request = base();
        mutate(&mut request);
        assert_eq!(blamed(find(request)), *fields, "row {row}");
    }
}

#[test]
fn every_field_of_search_and_requirements_is_checked() {
    fn budget(request: &mut v1::FindGraspRequest, seconds: i64, nanos: i32) {
        search(request).budget = Some(prost_types::Duration { seconds, nanos });
    }
    const TRIPOD: i32 = v1::GraspType::Tripod as i32;
    const THUMB: i32 = v1::Digit::Thumb as i32;
    assert_each_blamed(
        right_handed,
        &[
            (|r| budget(r, 0, 0), &["search.budget"]),
            (|r| budget(r, -1, 0), &["search.budget"]),
            (|r| budget(r, 1, -1), &["search.budget"]),
            (|r| budget(r, 0, 2_000_000_000), &["search.budget"]),
            (|r| budget(r, i64::MIN, i32::MIN), &["search.budget"]),
            (|r| budget(r, i64::MAX, 0), &["search.budget"]),
            (|r| search(r).max_attempts = Some(0), &["search.max_attempts"]),
            (
                |r| search(r).replay_attempt = Some(u64::MAX),
                &["search.replay_attempt"],
            ),
            // A choice that there is none of yet.
            (|r| search(r).choice = 4, &["search.choice"]),
            (
                |r| requirements(r).friction = Some(0.0),
                &["requirements.friction"],
            ),
            (
                |r| requirements(r).friction = Some(f32::NAN),
                &["requirements.friction"],
            ),
            (
                |r| requirements(r).friction = Some(50.0),
                &["requirements.friction"],
            ),
            (
                |r| requirements(r).allowed_grasp_types = vec![TRIPOD, 0, 34],
                &[
                    "requirements.allowed_grasp_types[1]",
                    "requirements.allowed_grasp_types[2]",
                ],
            ),
            (
                |r| requirements(r).excluded_grasp_types = vec![TRIPOD, 0, -1],
                &[
                    "requirements.excluded_grasp_types[1]",
                    "requirements.excluded_grasp_types[2]",
                ],
            ),
            (
                |r| {
                    requirements(r).allowed_grasp_types = vec![TRIPOD];
                    requirements(r).excluded_grasp_types = vec![TRIPOD];
                },
                &["requirements.excluded_grasp_types[0]"],
            ),
            (
                |r| requirements(r).excluded_grasp_types = (1..=33).collect(),
                &["requirements.excluded_grasp_types"],
            ),
            (
                |r| requirements(r).must_touch = vec![THUMB, 0, 6],
                &["requirements.must_touch[1]", "requirements.must_touch[2]"],
            ),
            (
                |r| {
                    requirements(r).must_touch = vec![THUMB];
                    requirements(r).must_not_touch = vec![-1, THUMB];
                },
                &["requirements.must_not_touch[0]", "requirements.must_not_touch[1]"],
            ),
            (
                |r| thesis(r).max_comfort = Some(-0.1),
                &["requirements.thesis.max_comfort"],
            ),
            (
                |r| thesis(r).max_comfort = Some(f32::INFINITY),
                &["requirements.thesis.max_comfort"],
            ),
            (
                |r| thesis(r).bend_ratios = -1,
                &["requirements.thesis.bend_ratios"],
            ),
        ],
    );
}

#[test]
fn every_field_of_a_current_grasp_is_checked() {
    assert_each_blamed(
        holding,
        &[
            (|r| current(r).grasp = None, &["current.grasp"]),
            (
                |r| current(r).min_score_gain = Some(f32::NAN),
                &["current.min_score_gain"],
            ),
            (|r| grasp(r).rig = "rigs/robot".into(), &["current.grasp.rig"]),
            (|r| grasp(r).rig = "rigs/thesis".into(), &["current.grasp.rig"]),
            (|r| grasp(r).scale = Some(1.5), &["current.grasp.scale"]),
            (|r| grasp(r).scale = Some(9.0), &["current.grasp.scale"]),
            (|r| grasp(r).handedness = 0, &["current.grasp.handedness"]),
            (|r| grasp(r).little = None, &["current.grasp.little"]),
            (|r| grasp(r).object_from_wrist = None, &["current.grasp"]),
            (|r| hand(r).rig.clear(), &["current.hand.rig"]),
            (|r| hand(r).object_from_wrist = None, &["current.hand"]),
            (|r| thesis(r).strategy = v1::Strategy::F.into(), &["current"]),
            (|r| search(r).replay_attempt = Some(3), &["current"]),
            // The other hand than the receiving one, and than the present one; either may be if the request leaves the choice.
            (
                |r| grasp(r).handedness = v1::Handedness::Left.into(),
                &["current.grasp.handedness", "current.hand.handedness"],
            ),
            (
                |r| {
                    grasp(r).handedness = v1::Handedness::Left.into();
                    r.receiver = None;
                },
                &["current.hand.handedness"],
            ),
        ],
    );
    let mut left = holding();
    left.receiver = None;
    grasp(&mut left).handedness = v1::Handedness::Left.into();
    hand(&mut left).handedness = v1::Handedness::Left.into();
    assert!(blamed(find(left)).is_empty());
}
