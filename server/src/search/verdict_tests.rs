//! Property tests: no grasp and no holdout makes judging or rating panic, and what is wrong is named.

use std::{cell::Cell, time::Duration};

use grasp_assets::hands::RIG_NAMES;
use grasp_proto::{
    v1::{self, validate_grasp_request::Grasp},
    wire_duration,
};
use grasp_synthesis::base::stop::Stop;
use proptest::{prelude::*, test_runner::TestRunner};

use super::{
    evaluate::EvaluateJob,
    job::tests::{job, number, objects, pose, request as any_request, runs, tracked_hand},
    judge::JudgeJob,
};
use crate::{
    error::ServiceError,
    rigs::store::RigStore,
    validate::{evaluate_query, validate_query},
};

/// The parts of requests, and what they have besides.
const FIELDS: [&str; 10] = [
    "holdout",
    "receiver",
    "requirements",
    "search",
    "output",
    "grasp",
    "pose",
    "joints",
    "nearest_budget",
    "other_presenting_hands",
];

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

/// A request for one hand, mostly under the default checks.
fn request() -> impl Strategy<Value = v1::FindGraspRequest> {
    (any_request(), 0..40_i32).prop_map(|(mut request, rare)| {
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
    let digit = || {
        let angle = || number(-1.5..1.5);
        let third = proptest::option::of(angle());
        let angles = (angle(), angle(), angle(), third);
        let angles = angles.prop_map(
            |(base_yaw, base_pitch, second_pitch, third_pitch)| v1::DigitAngles {
                base_yaw,
                base_pitch,
                second_pitch,
                third_pitch,
            },
        );
        proptest::option::weighted(0.99, angles)
    };
    let digits = [digit(), digit(), digit(), digit(), digit()];
    let scale = proptest::option::weighted(0.3, number(0.5..2.0));
    let posed = (
        digits,
        pose(0.2),
        0..3_i32,
        0..RIG_NAMES.len() + 1,
        scale,
        any::<bool>(),
    )
        .prop_map(|(digits, wrist, handedness, rig, scale, at_object)| {
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
        });
    prop_oneof![
        30 => posed.prop_map(|hand| Some(Grasp::Pose(hand))),
        10 => tracked_hand().prop_map(|hand| Some(Grasp::Joints(hand))),
        1 => Just(None),
    ]
    .boxed()
}

#[test]
fn judges_every_grasp_that_passes_validation() {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let judged = Cell::new([0; 2]);
    let parts = (
        request(),
        proptest::bool::weighted(0.99),
        grasp(),
        any::<bool>(),
        objects(),
    );
    let outcome = TestRunner::new(runs()).run(&parts, |(request, has_holdout, grasp, nearest, object)| {
        let is_tracked = matches!(grasp, Some(Grasp::Joints(_)));
        let request = v1::ValidateGraspRequest::from(request);
        let sent = v1::ValidateGraspRequest {
            holdout: request.holdout.filter(|_| has_holdout),
            grasp,
            nearest_budget: nearest.then(|| wire_duration(BUDGET)),
            ..request
        };
        let query = match validate_query(sent, ("adult", &RigStore::new(0, None)), |_| true) {
            Ok(query) => query,
            Err(error) => return assert_named(&error, &FIELDS),
        };
        let mut find = job(query.holdout, object);
        find.budget = BUDGET;
        let job = JudgeJob {
            find,
            grasp: query.grasp,
            find_nearest: query.find_nearest,
            warnings: query.warnings,
        };
        let response = match job.run(&pool, Stop::NEVER) {
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
    let outcome = TestRunner::new(runs()).run(
        &(request(), others, objects()),
        |(mut request, others, object)| {
            request.output_mut().key_frames = false;
            request.search_mut().replay_attempt = None;
            let sent = v1::EvaluateHoldoutRequest {
                other_presenting_hands: others.into_iter().map(Into::into).collect(),
                ..request.into()
            };
            let query = match evaluate_query(sent, ("adult", &RigStore::new(0, None)), |_| true) {
                Ok(query) => query,
                Err(error) => return assert_named(&error, &FIELDS),
            };
            let count = 1 + query.other_presenting_hands.len();
            let mut find = job(query.holdout, object);
            find.budget = BUDGET;
            let job = EvaluateJob {
                find,
                other_presenting_hands: query.other_presenting_hands,
            };
            let response = match job.run(&pool, Stop::NEVER) {
                Ok(evaluated) => evaluated.response,
                Err(error) => return assert_named(&error, &["holdout"]),
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
    outcome.unwrap_or_else(|failure| panic!("{failure}"));
    assert!(rated.get() >= 50, "{rated:?}");
}
