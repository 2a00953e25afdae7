//! Property tests: no grasp and no holdout makes judging or rating panic, and what is wrong is named.

use std::{cell::Cell, sync::atomic::AtomicBool, time::Duration};

use grasp_assets::hands::RIG_NAMES;
use grasp_proto::v1::{self, grasp_to_validate::Form};
use proptest::{prelude::*, test_runner::TestRunner};

use super::{
    evaluate::EvaluateJob,
    job::tests::{job, number, objects, pose, request, runs, tracked_hand},
    judge::JudgeJob,
};
use crate::{
    error::ServiceError,
    rigs::store::RigStore,
    validate::{evaluate_query, validate_query},
};

/// Searches must not make a test long.
const BUDGET: Duration = Duration::from_micros(300);

/// The first fields of a request.
fn assert_named(error: &ServiceError, first: &[&str]) -> Result<(), TestCaseError> {
    let ServiceError::Invalid(violations) = error else {
        return Err(TestCaseError::fail(error.to_string()));
    };
    prop_assert!(!violations.is_empty());
    for violation in violations {
        let root = violation.field.split(['.', '[']).next().unwrap_or_default();
        prop_assert!(
            first.contains(&root) || violation.field.is_empty(),
            "{:?}",
            violation
        );
        prop_assert!(!violation.description.is_empty());
    }
    Ok(())
}

/// A holdout of one hand under the default checks.
fn holdout() -> impl Strategy<Value = v1::FindGraspRequest> {
    (request(), 0..40_i32).prop_map(|(request, rare)| v1::FindGraspRequest {
        hands: if rare == 0 { request.hands } else { 0 },
        validity: if rare == 1 { v1::Validity::Thesis.into() } else { 0 },
        receiver: request.receiver.filter(|_| rare > 2),
        strategy: 0,
        ..request
    })
}

/// A hand with any angles, seldom with absurd ones or without a digit.
fn grasp() -> impl Strategy<Value = v1::GraspToValidate> {
    let digit = || {
        let angle = || number(-1.5..1.5);
        let third = proptest::option::of(angle());
        (angle(), angle(), angle(), third).prop_map(|(base_yaw, base_pitch, second_pitch, third_pitch)| {
            v1::DigitAngles {
                base_yaw,
                base_pitch,
                second_pitch,
                third_pitch,
            }
        })
    };
    let count = prop_oneof![50 => Just(5_usize), 1 => 0..7_usize];
    let digits = count.prop_flat_map(move |count| proptest::collection::vec(digit(), count));
    let scale = proptest::option::weighted(0.3, number(0.5..2.0));
    let posed = (
        digits.boxed(),
        pose(0.2),
        0..3_i32,
        0..RIG_NAMES.len() + 1,
        scale,
        any::<bool>(),
    )
        .prop_map(|(digits, wrist, handedness, rig, hand_scale, at_object)| {
            let rig = RIG_NAMES.get(rig).copied().unwrap_or("nobody").to_owned();
            if at_object {
                Form::Hand(v1::HandAtObject {
                    rig,
                    handedness,
                    hand_scale,
                    object_from_wrist: wrist,
                    digits,
                })
            } else {
                Form::Angles(v1::HandAngles {
                    rig,
                    handedness,
                    client_from_wrist: wrist,
                    digits,
                    hand_scale,
                })
            }
        });
    let tracked = tracked_hand().prop_map(|form| match form {
        v1::presenting_hand::Form::Joints(joints) => Form::Joints(joints),
        other => unreachable!("{other:?} is not tracked"),
    });
    let form = prop_oneof![30 => posed.prop_map(Some), 10 => tracked.prop_map(Some), 1 => Just(None)];
    form.prop_map(|form| v1::GraspToValidate { form })
}

#[test]
fn judges_every_grasp_that_passes_validation() {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let judged = Cell::new([0; 2]);
    let parts = (
        proptest::option::weighted(0.99, holdout()),
        grasp(),
        any::<bool>(),
        objects(),
    );
    let outcome = TestRunner::new(runs()).run(&parts, |(holdout, grasp, find_nearest, object)| {
        let is_tracked = matches!(grasp.form, Some(Form::Joints(_)));
        let sent = v1::ValidateGraspRequest {
            holdout,
            grasp: Some(grasp),
            find_nearest,
        };
        let query = match validate_query(sent, ("adult", &RigStore::new(0, None)), |_| true) {
            Ok(query) => query,
            Err(error) => return assert_named(&error, &["holdout", "grasp"]),
        };
        let mut find = job(query.holdout, object);
        find.budget = BUDGET;
        let job = JudgeJob {
            find,
            grasp: query.grasp,
            find_nearest: query.find_nearest,
            warnings: query.warnings,
        };
        let response = match job.run(&pool, &AtomicBool::new(false)) {
            Ok(judged) => judged.response,
            // A mesh may be no surface.
            Err(error) => return assert_named(&error, &["holdout"]),
        };
        let mut counts = judged.get();
        counts[usize::from(is_tracked)] += 1;
        judged.set(counts);
        prop_assert_eq!(response.verdicts.len(), 12);
        prop_assert_eq!(
            response.valid,
            response.verdicts.iter().all(|verdict| verdict.passed)
        );
        prop_assert_eq!(response.farthest_joint.is_some(), is_tracked);
        for verdict in &response.verdicts {
            let numbers = verdict.figure.into_iter().chain(verdict.bound);
            let at = verdict
                .client_position
                .into_iter()
                .flat_map(|at| [at.x, at.y, at.z]);
            for number in numbers.chain(at) {
                prop_assert!(number.is_finite(), "{:?}", verdict);
            }
            prop_assert!(!verdict.description.is_empty());
        }
        let grasp = response.grasp.expect("the grasp is there");
        prop_assert_eq!(grasp.score.is_some(), response.valid);
        Ok(())
    });
    outcome.unwrap_or_else(|failure| panic!("{failure}"));
    // The test is meaningful only if many grasps of both kinds pass validation.
    assert!(judged.get().iter().all(|&count| count >= 20), "{judged:?}");
}

#[test]
fn rates_every_holdout_that_passes_validation() {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let rated = Cell::new(0);
    let others = proptest::collection::vec(tracked_hand(), 0..3);
    let outcome =
        TestRunner::new(runs()).run(&(holdout(), others, objects()), |(holdout, others, object)| {
            let sent = v1::EvaluateHoldoutRequest {
                holdout: Some(v1::FindGraspRequest {
                    only_attempt: None,
                    plan_key_frames: false,
                    ..holdout
                }),
                other_presenting_hands: others
                    .into_iter()
                    .map(|form| v1::PresentingHand { form: Some(form) })
                    .collect(),
            };
            let query = match evaluate_query(sent, ("adult", &RigStore::new(0, None)), |_| true) {
                Ok(query) => query,
                Err(error) => return assert_named(&error, &["holdout", "other_presenting_hands"]),
            };
            let count = 1 + query.other_presenting_hands.len();
            let mut find = job(query.holdout, object);
            find.budget = BUDGET;
            let job = EvaluateJob {
                find,
                other_presenting_hands: query.other_presenting_hands,
            };
            let response = match job.run(&pool, &AtomicBool::new(false)) {
                Ok(evaluated) => evaluated.response,
                Err(error) => return assert_named(&error, &["holdout"]),
            };
            rated.set(rated.get() + 1);
            prop_assert_eq!(response.ratings.len(), count);
            let mut ranking = response.ranking.clone();
            ranking.sort_unstable();
            prop_assert_eq!(ranking, (0..count as u32).collect::<Vec<_>>());
            for rating in &response.ratings {
                prop_assert!(rating.best_score.is_finite() && rating.known == 0);
                prop_assert_eq!(rating.receivable, rating.reason == 0);
            }
            Ok(())
        });
    outcome.unwrap_or_else(|failure| panic!("{failure}"));
    assert!(rated.get() >= 50, "{rated:?}");
}
