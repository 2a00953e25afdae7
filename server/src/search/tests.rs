//! Any request that passes validation is answered, judged or rated without a panic, and what is wrong with others is named.

mod requests;

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

use requests::*;

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
