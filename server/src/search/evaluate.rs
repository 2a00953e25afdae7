//! Ratings of holdouts: for each pose of the giver's hand, how many of the known grips remain valid.

use std::time::{Duration, Instant};

use grasp_proto::v1;
use grasp_synthesis::{
    base::stop::Stop,
    model::{requirements::Check, score::Score},
    search::evaluation::{self, Evaluation, HINDRANCES, SIDES},
};
use rayon::ThreadPool;

use super::{
    job::{FindJob, PreparedJob},
    progress::{HandPlace, Progress},
};
use crate::{
    answer::wire_check,
    convention::Convention,
    error::ServiceError,
    executor::{Admission, SearchExecutor},
    validate::GiverHand,
};

/// A holdout to rate.
#[derive(Debug)]
pub(crate) struct EvaluateJob {
    /// The search of the holdout.
    pub find: FindJob,
    /// Further hands in place of the giver's.
    pub other_presenting_hands: Vec<GiverHand>,
}

/// The ratings, and when they were found.
#[derive(Debug)]
pub(crate) struct Evaluated {
    /// The response to the call.
    pub response: v1::EvaluateHoldoutResponse,
    /// When they were found.
    pub ended: Instant,
    /// How long that took.
    pub time: Duration,
    /// Attempts of all searches.
    pub attempts: u64,
}

/// Rates holdouts on the executor. Each giver has the same part of the budget; what is not checked by then does not count.
///
/// # Errors
/// [`ServiceError::DeadlineExceeded`], or the giver's mesh is no surface, or the work was stopped or panicked.
pub(crate) async fn evaluate(
    job: EvaluateJob,
    executor: &SearchExecutor,
    admission: Admission,
) -> Result<Evaluated, ServiceError> {
    let due = job.find.has_deadline.then(|| job.find.due());
    // Boxed: jobs of some kilobytes would make the futures of all calls large.
    let job = Box::new(job);
    executor
        .run_until(due, admission, move |pool, stop| job.run(pool, stop))
        .await
}

impl EvaluateJob {
    /// Rates, on the thread that calls.
    pub(super) fn run(self, pool: &ThreadPool, stop: Stop<'_>) -> Result<Evaluated, ServiceError> {
        let start = Instant::now();
        let Self {
            find,
            other_presenting_hands,
        } = self;
        let budget = find.budget;
        let givers = 1 + other_presenting_hands.len() as u32;
        let mut response = v1::EvaluateHoldoutResponse::default();
        let mut attempts = 0;
        let first = find.query.presenting_hand.clone();
        let hands = std::iter::once(first).chain(other_presenting_hands.into_iter().map(Some));
        for (place, presenting_hand) in hands.enumerate() {
            let mut of_giver = find.clone();
            of_giver.query.presenting_hand = presenting_hand;
            of_giver.budget = budget * (place as u32 + 1) / givers;
            of_giver.patience = of_giver.budget;
            let prepared = of_giver.prepare()?;
            if place == 0 {
                response.atlases = atlases(&prepared);
            }
            let warnings = prepared
                .warnings()
                .filter(|warning| !response.warnings.contains(warning));
            let warnings: Vec<String> = warnings.cloned().collect();
            response.warnings.extend(warnings);
            let (rating, tried) = rating(place as u32, &prepared, pool, stop);
            attempts += tried;
            response.ratings.push(rating);
            stop.check()?;
        }
        rank(&mut response.ratings);
        let ended = Instant::now();
        Ok(Evaluated {
            response,
            ended,
            time: ended - start,
            attempts,
        })
    }
}

/// The atlases that grips are known from.
fn atlases(prepared: &PreparedJob) -> Vec<v1::Atlas> {
    let knows = |place: &HandPlace| prepared.hands[*place].settings.known.atlas.is_some();
    let places = (0..prepared.hands.len()).filter(knows);
    places.filter_map(|place| prepared.atlas_used(place)).collect()
}

/// The rating of one giver, and the attempts that it took. Without a valid known grip, a search decides.
fn rating(
    presenting_hand: u32,
    prepared: &PreparedJob,
    pool: &ThreadPool,
    stop: Stop<'_>,
) -> (v1::HoldoutRating, u64) {
    let is_over = || stop.is_over() || prepared.is_over();
    let evaluation = prepared
        .hands()
        .map(|(_, task, settings)| evaluation::evaluate(task, settings, Stop::when(&is_over)))
        .fold(Evaluation::default(), |sum, hand| sum.with(&hand));
    let valid = evaluation.valid();
    let mut found = None;
    let mut attempts = 0;
    if valid == 0 && !is_over() {
        let outcome = prepared.search(pool, stop, &Progress::default()).outcome;
        attempts = outcome.report.attempts;
        found = outcome.grasp;
    }
    let found_score = found
        .as_ref()
        .map(|grasp| grasp.score.as_ref().map_or(0.0, Score::total));
    let no_grasp = if valid > 0 || found.is_some() {
        v1::Check::Unspecified
    } else {
        reason(&evaluation, prepared)
    };
    let hindrances = HINDRANCES.into_iter().map(|what| v1::CheckCount {
        check: wire_check(what).into(),
        count: evaluation.hindered_by(what).into(),
    });
    let rating = v1::HoldoutRating {
        presenting_hand,
        no_grasp: no_grasp.into(),
        best_score: found_score.unwrap_or_default().max(evaluation.best_score()),
        sides: sides(&evaluation, prepared.frame().convention),
        hindrances: hindrances.filter(|hindrance| hindrance.count > 0).collect(),
    };
    (rating, attempts)
}

/// Why there is no grasp, as far as is known.
fn reason(evaluation: &Evaluation, prepared: &PreparedJob) -> v1::Check {
    let count = |what| evaluation.hindered_by(what);
    let obstructed =
        count(Check::GiverClearance) + count(Check::OtherHandsClearance) + count(Check::ObstacleClearance);
    if !prepared.limits().is_empty() {
        v1::Check::Holdable
    } else if count(Check::Reach) > obstructed {
        v1::Check::Reach
    } else if obstructed > 0 {
        v1::Check::GiverClearance
    } else {
        v1::Check::Time
    }
}

fn sides(evaluation: &Evaluation, convention: Convention) -> Vec<v1::ObjectSide> {
    let sides = SIDES.into_iter().zip(&evaluation.sides);
    let sides = sides.map(|(from, side)| v1::ObjectSide {
        direction: Some(convention.direction_at_object_from_openxr(from).into()),
        known: side.known,
        valid: side.valid,
        best_score: side.best_score,
    });
    sides.collect()
}

/// Sorts ratings from the best on; equal ones stay in their order.
fn rank(ratings: &mut [v1::HoldoutRating]) {
    let is_receivable = |rating: &v1::HoldoutRating| rating.no_grasp() == v1::Check::Unspecified;
    ratings.sort_by(|a, b| {
        let by_receivable = is_receivable(b).cmp(&is_receivable(a));
        by_receivable
            .then_with(|| valid_share(b).total_cmp(&valid_share(a)))
            .then_with(|| b.best_score.total_cmp(&a.best_score))
    });
}

/// The share of the known grips that are valid; 0 without any.
fn valid_share(rating: &v1::HoldoutRating) -> f32 {
    let sides = rating.sides.iter();
    let [known, valid] = sides.fold([0; 2], |[known, valid], side| {
        [known + side.known, valid + side.valid]
    });
    valid as f32 / known.max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_receivable_ones_first_then_by_share_and_score() {
        let rating = |presenting_hand, receivable, valid, best_score| v1::HoldoutRating {
            presenting_hand,
            no_grasp: if receivable {
                v1::Check::Unspecified
            } else {
                v1::Check::Time
            }
            .into(),
            best_score,
            sides: vec![
                v1::ObjectSide {
                    known: 6,
                    valid,
                    ..v1::ObjectSide::default()
                },
                v1::ObjectSide {
                    known: 4,
                    ..v1::ObjectSide::default()
                },
            ],
            ..v1::HoldoutRating::default()
        };
        let mut ratings = [
            rating(0, false, 0, 0.0),
            rating(1, true, 2, 0.9),
            rating(2, true, 5, 0.1),
            rating(3, true, 5, 0.4),
            rating(4, true, 0, 0.8),
            rating(5, false, 0, 0.0),
        ];
        rank(&mut ratings);
        assert_eq!(ratings.map(|rating| rating.presenting_hand), [3, 2, 1, 4, 0, 5]);
    }
}
