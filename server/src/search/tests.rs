//! Any request that passes validation is answered, judged or rated without a panic, and what is wrong with others is named.

use std::{
    cell::Cell,
    sync::Arc,
    time::{Duration, Instant},
};

use glam::{Quat, Vec3};
use grasp_assets::hands::{self, RIG_NAMES};
use grasp_proto::{
    v1::{self, validate_grasp_request::Grasp},
    wire_duration,
};
use grasp_synthesis::{
    base::{
        pose::Pose,
        stop::{Stop, unstopped},
    },
    model::hand::{Handedness, rig::AngleRange},
};
use proptest::{
    array, collection, option,
    prelude::*,
    sample,
    test_runner::{Config, RngSeed, TestRunner},
};
use rayon::ThreadPool;

use super::{prepared::Answered, slices::Progress, *};
use crate::{
    convention::Convention,
    error::ServiceError,
    objects::{StoredObject, tests::tetrahedron},
    rigs::store::RigStore,
    validate::{
        EvaluateQuery, FindQuery, GiverHand, ValidateQuery, any_obstacles, evaluate_query, find_query,
        fixtures, validate_query,
    },
};

/// The parts of requests to validate a grasp or evaluate a holdout.
const FIELDS: &str =
    "holdout receiver requirements search output grasp pose joints nearest_budget other_presenting_hands";

/// The budget of judging and rating, whose searches would make the tests long.
const SHORT: Duration = Duration::from_micros(300);

/// Any number that a client may send, most of them ordinary.
fn number(ordinary: std::ops::Range<f32>) -> impl Strategy<Value = f32> {
    prop_oneof![1000 => ordinary, 1 => any::<f32>(), 1 => Just(0.0)]
}

fn vector(ordinary: f32) -> impl Strategy<Value = Vec3> {
    let coordinate = || number(-ordinary..ordinary);
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from_array)
}

/// Mostly unit quaternions.
fn quaternion() -> impl Strategy<Value = Quat> {
    let turned = [-2.0_f32..2.0, -2.0_f32..2.0, -2.0_f32..2.0]
        .prop_map(|turn| Quat::from_scaled_axis(Vec3::from_array(turn)));
    let any = any::<[f32; 4]>().prop_map(Quat::from_array);
    prop_oneof![500 => turned, 1 => any]
}

prop_compose! {
    fn any_pose(ordinary: f32)(
        position in option::of(vector(ordinary)),
        orientation in option::of(quaternion()),
    ) -> v1::Pose {
        v1::Pose { position: position.map(Into::into), orientation: orientation.map(Into::into) }
    }
}

/// Boxed, like all strategies that others repeat: without optimisation, nested value trees outgrow a test's stack of 2 MiB.
fn pose(ordinary: f32) -> BoxedStrategy<Option<v1::Pose>> {
    option::weighted(0.998, any_pose(ordinary)).boxed()
}

prop_compose! {
    /// A hand in any pose, seldom with a joint that is anywhere.
    fn tracked_hand()(
        position in vector(1.0),
        orientation in quaternion(),
        stray in option::weighted(0.1, (0..25_usize, pose(0.12), number(0.0..0.05))),
        handedness in prop_oneof![Just(Handedness::Left), Just(Handedness::Right)],
        is_webxr in any::<bool>(),
    ) -> v1::HandJoints {
        let set = if is_webxr { fixtures::JointSet::WebXr } else { fixtures::JointSet::OpenXr };
        let hand = fixtures::joints_of_a_rig(handedness).transformed(Pose { position, orientation });
        let mut hand = fixtures::sent(&hand, Convention::OpenXr, set);
        if let Some((joint, pose, radius)) = stray {
            hand.joints[joint] = v1::JointPose { pose, radius };
        }
        hand
    }
}

/// The digits of a built-in rig, given as shares of their ranges.
fn digits(rig: &str, shares: &[[f32; 3]]) -> [Option<v1::DigitAngles>; 5] {
    let hand = hands::hand(rig, Handedness::Right).expect("the rig is built in");
    let within = |range: AngleRange, share: f32| range.min + share * (range.max - range.min);
    std::array::from_fn(|digit| {
        let (limits, share) = (hand.rig.digits[digit].limits, shares[digit]);
        Some(v1::DigitAngles {
            base_yaw: within(limits.base_yaw, share[0]),
            base_pitch: within(limits.base_pitch, share[1]),
            second_pitch: within(limits.second_pitch, share[2]),
            third_pitch: None,
        })
    })
}

fn shares() -> impl Strategy<Value = Vec<[f32; 3]>> {
    collection::vec([number(0.0..1.0), number(0.0..1.0), number(0.0..1.0)], 5)
}

prop_compose! {
    /// A posed hand of a built-in rig.
    fn posed_hand()(
        shares in shares(),
        client_from_wrist in pose(0.2),
        handedness in 1..=2_i32,
        rig in sample::select(&RIG_NAMES[..]),
        scale in option::weighted(0.3, number(0.5..2.0)),
    ) -> v1::HandPose {
        let name = format!("rigs/{rig}");
        v1::HandPose { rig: name, handedness, client_from_wrist, scale, ..v1::HandPose::default() }
            .with_digits(digits(rig, &shares))
    }
}

prop_compose! {
    /// Some triangles near the object, closed or not.
    fn hand_mesh()(
        client_coordinates in collection::vec(number(-0.1..0.1), 24),
        mut triangles in collection::vec(0..8_u32, 12),
        client_from_wrist in option::of(pose(0.2)),
    ) -> v1::HandMesh {
        // A tetrahedron as well.
        triangles.extend([0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2]);
        v1::HandMesh { client_coordinates, triangles, client_from_wrist: client_from_wrist.flatten() }
    }
}

/// A hand to keep clear of.
fn giver() -> BoxedStrategy<v1::PresentingHand> {
    prop_oneof![
        2 => tracked_hand().prop_map(v1::PresentingHand::from),
        1 => posed_hand().prop_map(v1::PresentingHand::from),
        1 => hand_mesh().prop_map(v1::PresentingHand::from),
    ]
    .boxed()
}

prop_compose! {
    /// A body near the object, seldom one that is anywhere.
    fn receiver()(
        shoulder in option::of(vector(1.0)),
        root in pose(1.0),
        body_height in number(0.8..2.5),
        upper_arm_length in option::weighted(0.3, number(0.1..0.6)),
        forearm_length in option::weighted(0.3, number(0.1..0.6)),
        max_reach in option::weighted(0.2, number(0.3..1.0)),
    ) -> v1::Receiver {
        use v1::receiver::Body;
        let (body, height) = match shoulder {
            Some(shoulder) => (Body::ClientShoulder(shoulder.into()), 0.0),
            None => (Body::ClientFromRoot(root.unwrap_or_default()), body_height),
        };
        let body = Some(body);
        v1::Receiver { body, height, upper_arm_length, forearm_length, max_reach, ..v1::Receiver::default() }
    }
}

prop_compose! {
    /// A hand of the default rig near the object, seldom anywhere.
    fn hand_at_object(handedness: i32)(
        shares in shares(),
        object_from_wrist in pose(0.15),
    ) -> v1::HandPose {
        let rig = "rigs/thesis".to_owned();
        v1::HandPose { rig, handedness, object_from_wrist, ..v1::HandPose::default() }
            .with_digits(digits("thesis", &shares))
    }
}

prop_compose! {
    fn current()(side in 1..=2_i32)(
        grasp in hand_at_object(side),
        hand in option::of(hand_at_object(side)),
        min_score_gain in option::of(number(0.0..1.0)),
        committed in any::<bool>(),
    ) -> v1::CurrentGrasp {
        v1::CurrentGrasp { grasp: Some(grasp), hand, min_score_gain, committed }
    }
}

prop_compose! {
    /// Searches of any kind, most of them valid.
    fn request()(
        presenting_hand in option::of(giver()),
        other_hand in option::weighted(0.2, giver()),
        obstacles in any_obstacles(),
        client_from_object in pose(2.0),
        up in option::of(vector(1.0)),
        (strategy, bend_ratios, convention, handedness) in (0..8_i32, 0..8_i32, 0..6_i32, 0..3_i32),
        (seed, replay_attempt) in any::<(Option<u64>, Option<u64>)>(),
        (is_reproducible, both_hands, changes_only) in any::<(bool, bool, bool)>(),
        friction in option::of(number(0.05..2.0)),
        receiver in option::weighted(0.2, receiver().boxed()),
        current in option::weighted(0.3, current().boxed()),
    ) -> v1::FindGraspRequest {
        let choice = [v1::GraspChoice::Unspecified, v1::GraspChoice::Reproducible][usize::from(is_reproducible)];
        // Only GUIDED holds on to a grasp: most requests that are to have it.
        let is_guided = current.is_some() && strategy % 4 != 0;
        v1::FindGraspRequest {
            holdout: Some(v1::Holdout {
                client_from_object,
                presenting_hand,
                up: up.map(Into::into),
                other_hands: other_hand.into_iter().collect(),
                obstacles,
                ..v1::Holdout::new("objects/any")
            }),
            receiver: Some(v1::Receiver {
                handedness,
                both_hands,
                // Both hands have no body and no current grasp.
                ..receiver.filter(|_| !both_hands).unwrap_or_default()
            }),
            requirements: Some(v1::Requirements {
                friction,
                thesis: Some(v1::ThesisOptions {
                    strategy: if is_guided { v1::Strategy::Guided.into() } else { strategy },
                    bend_ratios,
                    ..v1::ThesisOptions::default()
                }),
                ..v1::Requirements::default()
            }),
            search: Some(v1::SearchOptions {
                max_attempts: Some(2),
                choice: choice.into(),
                seed,
                // A replay names its hand.
                replay_attempt: replay_attempt.filter(|_| handedness > 0 && current.is_none()),
                ..v1::SearchOptions::default()
            }),
            output: Some(v1::OutputOptions { convention, key_frames: !both_hands, changes_only }),
            current: current.filter(|_| !both_hands),
        }
    }
}

/// Objects from a speck to a beam.
fn objects() -> impl Strategy<Value = StoredObject> {
    prop_oneof![Just(0.002_f32), Just(0.05), Just(9.0)].prop_map(|edge| tetrahedron("any", edge, &[1]))
}

/// A search by one worker for the default budget, without known grips.
pub(super) fn job(query: FindQuery, object: StoredObject) -> FindJob {
    FindJob {
        budget: query.limits.budget.unwrap_or(Duration::from_secs(1)),
        patience: Duration::ZERO,
        has_deadline: false,
        query,
        _held: Arc::default(),
        derived: unstopped(|stop| object.derived_until(stop)),
        stored: Arc::new(object),
        resized: None,
        seed: 3,
        arrived: Instant::now(),
        workers: 1,
        refinement: Duration::from_micros(100),
        known: Default::default(),
    }
}

/// Checks a property of many values; it has a pool of one thread.
fn check<S: Strategy>(values: S, property: impl Fn(&ThreadPool, S::Value) -> Result<(), TestCaseError>) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.expect("a thread");
    let config = Config {
        cases: 1000,
        rng_seed: RngSeed::Fixed(2),
        failure_persistence: None,
        ..Config::default()
    };
    let outcome = TestRunner::new(config).run(&values, |value| property(&pool, value));
    outcome.unwrap_or_else(|failure| panic!("{failure}"));
}

#[test]
fn answers_every_request_that_passes_validation() {
    let searched = Cell::new([0; 5]);
    check((request(), objects()), |pool, (request, object)| {
        let Ok(query) = find_query(request, ("thesis", &RigStore::new(0, None)), |_| true) else {
            return Ok(());
        };
        let kind = match &query.presenting_hand {
            None => 0,
            Some(GiverHand::Jointed(giver)) if giver.field.ends_with("pose") => 1,
            Some(GiverHand::Jointed(_)) => 2,
            Some(GiverHand::Meshed(_)) => 3,
        };
        let mut counts = searched.get();
        counts[kind] += 1;
        let has_current = query.current.is_some();
        counts[4] += usize::from(has_current);
        searched.set(counts);
        let takes_both = query.other_hand.is_some();
        let changes_only = query.changes_only;
        let prepared = job(query, object).prepare();
        match prepared.and_then(|job| job.run(pool, Stop::NEVER, &Progress::default())) {
            Ok(Answered { response: answer, .. }) => {
                let report = answer.report.as_ref().expect("every answer has a report");
                prop_assert!(report.attempts <= 2);
                prop_assert_eq!(answer.current.is_some(), has_current);
                let mut is_known = false;
                if let Some(current) = &answer.current {
                    let is_aborted = current.status() == v1::CurrentGraspStatus::Aborted;
                    prop_assert_eq!(current.withdrawal.is_some(), is_aborted);
                    prop_assert_eq!(answer.outcome() == v1::Outcome::Aborted, is_aborted);
                    let motion = current.motion.iter();
                    let mut motion =
                        motion.flat_map(|motion| [motion.distance, motion.angle, motion.fingertips]);
                    prop_assert!(motion.all(f32::is_finite));
                    let failed = current.failed_check.iter();
                    let numbers = failed.flat_map(|check| [check.value, check.bound]);
                    prop_assert!(numbers.flatten().all(f32::is_finite), "{current:?}");
                    is_known = changes_only && current.status() == v1::CurrentGraspStatus::Kept;
                }
                let expected = match answer.outcome() {
                    v1::Outcome::Found if takes_both => 2,
                    v1::Outcome::Found => 1,
                    _ => 0,
                };
                prop_assert_eq!(answer.grasps.len(), expected);
                for arm in answer.grasps.iter().filter_map(|grasp| grasp.arm) {
                    prop_assert!(Vec3::from(arm.client_elbow.expect("every arm has an elbow")).is_finite());
                }
                for grasp in &answer.grasps {
                    let hand = grasp.hand.as_ref().expect("every grasp has a hand");
                    prop_assert!(hand.client_from_wrist.is_some() && hand.object_from_wrist.is_some());
                    prop_assert!(hand.convention() != v1::Convention::Unspecified);
                    prop_assert_eq!(hand.joints.is_empty(), is_known);
                    prop_assert_eq!(hand.thumb.is_none(), is_known);
                    let poses = hand
                        .joints
                        .iter()
                        .map(|joint| joint.pose.expect("every joint has a pose"));
                    prop_assert!(poses.into_iter().all(|pose| pose.position().is_finite()));
                }
            }
            Err(error) => prop_assert!(matches!(error, ServiceError::Invalid(_)), "{}", error),
        }
        Ok(())
    });
    // The test is meaningful only if many requests of every kind pass validation.
    assert!(searched.get().iter().all(|&count| count >= 20), "{searched:?}");
}

/// Checks that each violation is of one of these fields of the request, and says what is wrong.
fn assert_named(error: &ServiceError, fields: &str) -> Result<(), TestCaseError> {
    let ServiceError::Invalid(violations) = error else {
        return Err(TestCaseError::fail(error.to_string()));
    };
    prop_assert!(!violations.is_empty());
    for violation in violations {
        let root = violation.field.split(['.', '[']).next().unwrap_or_default();
        let is_field = root.is_empty() || fields.split(' ').any(|field| field == root);
        prop_assert!(is_field && !violation.description.is_empty(), "{violation:?}");
    }
    Ok(())
}

/// A request for one hand, mostly under the default checks.
fn one_hand_request() -> impl Strategy<Value = v1::FindGraspRequest> {
    (request(), 0..40_i32).prop_map(|(mut request, rare)| {
        let receiver = request.receiver_mut();
        receiver.both_hands &= rare == 0;
        if rare <= 2 {
            receiver.body = None;
            receiver.max_reach = None;
        }
        request.requirements_mut().thesis = (rare == 1).then(|| v1::ThesisOptions {
            thesis_validity: true,
            ..v1::ThesisOptions::default()
        });
        request
    })
}

/// A hand with any angles, seldom with absurd ones or without a digit.
fn grasp() -> BoxedStrategy<Option<Grasp>> {
    let angles = array::uniform4(number(-1.5..1.5)).prop_map(v1::DigitAngles::new);
    let digits = array::uniform5(option::weighted(0.99, angles));
    let scale = option::weighted(0.3, number(0.5..2.0));
    let rig = 0..RIG_NAMES.len() + 1;
    let posed = (digits, pose(0.2), 0..3_i32, rig, scale, any::<bool>()).prop_map(
        |(digits, wrist, handedness, rig, scale, at_object)| {
            let rig = RIG_NAMES.get(rig).copied().unwrap_or("nobody");
            v1::HandPose {
                rig: format!("rigs/{rig}"),
                handedness,
                scale,
                object_from_wrist: wrist.filter(|_| at_object),
                client_from_wrist: wrist.filter(|_| !at_object),
                ..v1::HandPose::default()
            }
            .with_digits(digits)
        },
    );
    prop_oneof![
        30 => posed.prop_map(|hand| Some(Grasp::Pose(hand))),
        10 => tracked_hand().prop_map(|hand| Some(Grasp::Joints(hand))),
        1 => Just(None),
    ]
    .boxed()
}

#[test]
fn judges_every_grasp_that_passes_validation() {
    let judged = Cell::new([0; 2]);
    let parts = (
        one_hand_request(),
        proptest::bool::weighted(0.99),
        grasp(),
        any::<bool>(),
        objects(),
    );
    check(parts, |pool, (request, has_holdout, grasp, nearest, object)| {
        let is_tracked = matches!(grasp, Some(Grasp::Joints(_)));
        let request = v1::ValidateGraspRequest::from(request);
        let sent = v1::ValidateGraspRequest {
            holdout: request.holdout.filter(|_| has_holdout),
            grasp,
            nearest_budget: nearest.then(|| wire_duration(SHORT)),
            ..request
        };
        let ValidateQuery {
            holdout,
            grasp,
            find_nearest,
            warnings,
        } = match validate_query(sent, ("adult", &RigStore::new(0, None)), |_| true) {
            Ok(query) => query,
            Err(error) => return assert_named(&error, FIELDS),
        };
        let mut find = job(holdout, object);
        find.budget = SHORT;
        let response = match judge(find, &grasp, find_nearest, warnings, pool, Stop::NEVER) {
            Ok(judged) => judged.response,
            // A mesh may be no surface.
            Err(error) => return assert_named(&error, "holdout"),
        };
        let mut counts = judged.get();
        counts[usize::from(is_tracked)] += 1;
        judged.set(counts);
        prop_assert_eq!(response.verdicts.len(), 12);
        prop_assert_eq!(
            response.valid,
            response.verdicts.iter().all(|verdict| verdict.passed)
        );
        prop_assert_eq!(response.joint_error.is_some(), is_tracked);
        for verdict in &response.verdicts {
            let numbers = verdict.value.into_iter().chain(verdict.bound);
            let at = verdict.r#where.into_iter().flat_map(|at| [at.x, at.y, at.z]);
            for number in numbers.chain(at) {
                prop_assert!(number.is_finite(), "{:?}", verdict);
            }
            prop_assert!(!verdict.description.is_empty());
        }
        let grasp = response.grasp.expect("the grasp is there");
        prop_assert_eq!(grasp.score.is_some(), response.valid);
        for margin in &grasp.margins {
            let mut verdicts = response.verdicts.iter();
            let verdict = verdicts.find(|verdict| verdict.check == margin.check);
            let verdict = verdict.expect("every margin has a verdict");
            prop_assert_eq!(
                (margin.passed, margin.value, margin.bound),
                (verdict.passed, verdict.value, verdict.bound)
            );
        }
        Ok(())
    });
    // The test is meaningful only if many grasps of both kinds pass validation.
    assert!(judged.get().iter().all(|&count| count >= 20), "{judged:?}");
}

#[test]
fn rates_every_holdout_that_passes_validation() {
    let rated = Cell::new(0);
    let others = collection::vec(tracked_hand(), 0..3);
    check(
        (one_hand_request(), others, objects()),
        |pool, (mut request, others, object)| {
            request.output_mut().key_frames = false;
            request.search_mut().replay_attempt = None;
            let sent = v1::EvaluateHoldoutRequest {
                other_presenting_hands: others.into_iter().map(Into::into).collect(),
                ..request.into()
            };
            let EvaluateQuery {
                holdout,
                other_presenting_hands,
            } = match evaluate_query(sent, ("adult", &RigStore::new(0, None)), |_| true) {
                Ok(query) => query,
                Err(error) => return assert_named(&error, FIELDS),
            };
            let count = 1 + other_presenting_hands.len();
            let mut find = job(holdout, object);
            find.budget = SHORT;
            let response = match rate(&find, other_presenting_hands, pool, Stop::NEVER) {
                Ok(evaluated) => evaluated.response,
                Err(error) => return assert_named(&error, "holdout"),
            };
            rated.set(rated.get() + 1);
            prop_assert_eq!(response.ratings.len(), count);
            let mut places: Vec<u32> = response
                .ratings
                .iter()
                .map(|rating| rating.presenting_hand)
                .collect();
            places.sort_unstable();
            prop_assert_eq!(places, (0..count as u32).collect::<Vec<_>>());
            for rating in &response.ratings {
                prop_assert!(rating.best_score.is_finite());
                prop_assert!(rating.sides.len() == 6 && rating.sides.iter().all(|side| side.known == 0));
            }
            let receivable = response.ratings.iter();
            let receivable = receivable.map(|rating| rating.no_grasp() == v1::Check::Unspecified);
            prop_assert!(receivable.is_sorted_by(|before, after| before >= after));
            Ok(())
        },
    );
    assert!(rated.get() >= 50, "{rated:?}");
}
