//! Any valid request is answered, judged or rated without a panic, and the errors of others are named.

mod requests;

use std::{
    cell::Cell,
    sync::Arc,
    time::{Duration, Instant},
};

use glam::{Quat, Vec3};
use grasp_assets::hands;
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
    collection, option,
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
    executor::Workers,
    objects::{StoredObject, tests::tetrahedron},
    rigs::store::RigStore,
    validate::{FindQuery, GiverHand, any_obstacles, evaluate_query, find_query, fixtures, validate_query},
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
    check((request(), edges()), |pool, (request, edge)| {
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
        let prepared = job(query, tetrahedron("any", edge, &[1])).prepare();
        match prepared.and_then(|job| job.run(Workers::alone(pool), Stop::NEVER, &Progress::default())) {
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
                    let motion = motion.flat_map(|motion| [motion.distance, motion.angle, motion.fingertips]);
                    let failed = current.failed_check.iter();
                    let failed = failed.flat_map(|check| [check.value, check.bound]).flatten();
                    prop_assert!(motion.chain(failed).all(f32::is_finite), "{current:?}");
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
                    prop_assert_eq!(
                        (hand.joints.is_empty(), hand.thumb.is_none()),
                        (is_known, is_known)
                    );
                    let mut poses = hand.joints.iter().map(|joint| joint.pose.expect("it has a pose"));
                    prop_assert!(poses.all(|pose| pose.position().is_finite()));
                }
            }
            Err(error) => prop_assert!(matches!(error, ServiceError::Invalid(_)), "{}", error),
        }
        Ok(())
    });
    // The test is meaningful only if many requests of every kind pass validation.
    assert!(searched.get().iter().all(|&count| count >= 20), "{searched:?}");
}

/// Checks that each violation is of one of these fields of the request, and has a description.
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

#[test]
fn judges_and_rates_every_request_that_passes_validation() {
    let examined = Cell::new([0; 3]);
    let count = |kind: usize| {
        let mut counts = examined.get();
        counts[kind] += 1;
        examined.set(counts);
    };
    let parts = (
        one_hand_request(),
        proptest::bool::weighted(0.99),
        grasp(),
        any::<bool>(),
        collection::vec(tracked_hand(), 0..3),
        edges(),
    );
    check(
        parts,
        |pool, (mut request, has_holdout, grasp, nearest, others, edge)| {
            let prepared = |query| FindJob {
                budget: SHORT,
                ..job(query, tetrahedron("any", edge, &[1]))
            };
            let is_tracked = matches!(grasp, Some(Grasp::Joints(_)));
            let validate = v1::ValidateGraspRequest::from(request.clone());
            let validate = v1::ValidateGraspRequest {
                holdout: validate.holdout.filter(|_| has_holdout),
                grasp,
                nearest_budget: nearest.then(|| wire_duration(SHORT)),
                ..validate
            };
            let judged = validate_query(validate, ("adult", &RigStore::new(0, None)), |_| true);
            match judged.map(|judged| {
                let find = prepared(judged.holdout);
                judge(
                    find,
                    &judged.grasp,
                    judged.find_nearest,
                    judged.warnings,
                    Workers::alone(pool),
                    Stop::NEVER,
                )
            }) {
                Err(error) => assert_named(&error, FIELDS)?,
                // A mesh may be no surface.
                Ok(Err(error)) => assert_named(&error, "holdout")?,
                Ok(Ok(judged)) => {
                    count(usize::from(is_tracked));
                    assert_judged(&judged.response, is_tracked)?;
                }
            }
            request.output_mut().key_frames = false;
            request.search_mut().replay_attempt = None;
            let givers = 1 + others.len() as u32;
            let evaluate = v1::EvaluateHoldoutRequest {
                other_presenting_hands: others.into_iter().map(Into::into).collect(),
                ..request.into()
            };
            let rated = evaluate_query(evaluate, ("adult", &RigStore::new(0, None)), |_| true);
            match rated.map(|rated| {
                let find = prepared(rated.holdout);
                rate(
                    &find,
                    rated.other_presenting_hands,
                    Workers::alone(pool),
                    Stop::NEVER,
                )
            }) {
                Err(error) => assert_named(&error, FIELDS)?,
                Ok(Err(error)) => assert_named(&error, "holdout")?,
                Ok(Ok(rated)) => {
                    count(2);
                    assert_rated(&rated.response, givers)?;
                }
            }
            Ok(())
        },
    );
    // The test is meaningful only if many of each kind pass validation.
    let [posed, tracked, rated] = examined.get();
    assert!(posed >= 20 && tracked >= 20 && rated >= 50, "{examined:?}");
}

fn assert_judged(response: &v1::ValidateGraspResponse, is_tracked: bool) -> Result<(), TestCaseError> {
    prop_assert_eq!(response.verdicts.len(), 12);
    prop_assert_eq!(
        response.valid,
        response.verdicts.iter().all(|verdict| verdict.passed)
    );
    prop_assert_eq!(response.joint_error.is_some(), is_tracked);
    for verdict in &response.verdicts {
        let at = verdict.r#where.into_iter().flat_map(|at| [at.x, at.y, at.z]);
        let mut numbers = verdict.value.into_iter().chain(verdict.bound).chain(at);
        prop_assert!(numbers.all(f32::is_finite), "{:?}", verdict);
        prop_assert!(!verdict.description.is_empty());
    }
    let grasp = response.grasp.as_ref().expect("the grasp is there");
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
}

fn assert_rated(response: &v1::EvaluateHoldoutResponse, givers: u32) -> Result<(), TestCaseError> {
    let ratings = response.ratings.iter();
    let mut places: Vec<u32> = ratings.clone().map(|rating| rating.presenting_hand).collect();
    places.sort_unstable();
    prop_assert_eq!(places, (0..givers).collect::<Vec<_>>());
    for rating in ratings.clone() {
        prop_assert!(rating.best_score.is_finite());
        prop_assert!(rating.sides.len() == 6 && rating.sides.iter().all(|side| side.known == 0));
    }
    let receivable = ratings.map(|rating| rating.no_grasp() == v1::Check::Unspecified);
    prop_assert!(receivable.is_sorted_by(|before, after| before >= after));
    Ok(())
}
