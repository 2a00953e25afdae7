//! Ratings of holdouts: for each pose of the giver's hand, how many of the known grips remain valid.

use std::{
    cmp::Ordering as Compared,
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use grasp_proto::v1;
use grasp_synthesis::{
    base::stop::Stop,
    model::score::Score,
    search::evaluation::{self, Evaluation, InTheWay, SIDES},
};
use rayon::ThreadPool;

use super::{
    job::{FindJob, PreparedJob},
    on_executor::{on_executor, within_holdout},
    progress::Progress,
};
use crate::{
    answer::{ClientFrame, atlas_stamp, vector, wire_duration},
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
    on_executor(due, executor, admission, move |pool, stop| job.run(pool, stop)).await
}

impl EvaluateJob {
    /// Rates, on the thread that calls.
    pub(super) fn run(self, pool: &ThreadPool, stop: &AtomicBool) -> Result<Evaluated, ServiceError> {
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
            let prepared = of_giver.prepare().map_err(within_holdout)?;
            if place == 0 {
                response.atlas_stamps = stamps(&prepared);
            }
            let warnings = prepared
                .warnings()
                .filter(|warning| !response.warnings.contains(warning));
            let warnings: Vec<String> = warnings.cloned().collect();
            response.warnings.extend(warnings);
            let (rating, tried) = rating(place as u32, &prepared, pool, stop);
            attempts += tried;
            response.ratings.push(rating);
            if stop.load(Ordering::Relaxed) {
                return Err(ServiceError::Cancelled);
            }
        }
        response.ranking = ranking(&response.ratings);
        let ended = Instant::now();
        let time = ended - start;
        response.time = Some(wire_duration(time));
        Ok(Evaluated {
            response,
            ended,
            time,
            attempts,
        })
    }
}

/// The stamps of the atlases that grips are known from.
fn stamps(prepared: &PreparedJob) -> Vec<String> {
    let atlases = prepared
        .hands()
        .map(|(_, _, settings)| settings.known.atlas.as_ref());
    let stamps: Vec<String> = atlases
        .map(|atlas| atlas.map(|atlas| atlas_stamp(atlas)).unwrap_or_default())
        .collect();
    if stamps.iter().all(String::is_empty) {
        Vec::new()
    } else {
        stamps
    }
}

/// The rating of one giver, and the attempts that it took. Without a valid known grip, a search decides.
fn rating(
    presenting_hand: u32,
    prepared: &PreparedJob,
    pool: &ThreadPool,
    stop: &AtomicBool,
) -> (v1::HoldoutRating, u64) {
    let is_over = || stop.load(Ordering::Relaxed) || prepared.is_over();
    let evaluation = prepared
        .hands()
        .map(|(_, task, settings)| evaluation::evaluate(task, settings, Stop::when(&is_over)))
        .fold(Evaluation::default(), |sum, hand| sum.with(&hand));
    let (known, valid) = (evaluation.known(), evaluation.valid());
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
    let receivable = valid > 0 || found.is_some();
    let share = |count: u32| count as f32 / known.max(1) as f32;
    let rating = v1::HoldoutRating {
        presenting_hand,
        receivable,
        reason: if receivable {
            v1::NoGraspReason::Unspecified
        } else {
            reason(&evaluation, prepared)
        }
        .into(),
        known,
        valid,
        valid_share: share(valid),
        best_score: found_score.unwrap_or_default().max(evaluation.best_score()),
        sides: sides(&evaluation, prepared.frame()),
        hindrances: InTheWay::ALL
            .into_iter()
            .filter(|&what| evaluation.hindered_by(what) > 0)
            .map(|what| v1::Hindrance {
                what: wire_in_the_way(what).into(),
                share: share(evaluation.hindered_by(what)),
            })
            .collect(),
    };
    (rating, attempts)
}

/// Why there is no grasp, as far as is known.
fn reason(evaluation: &Evaluation, prepared: &PreparedJob) -> v1::NoGraspReason {
    let count = |what| evaluation.hindered_by(what);
    let obstructed =
        count(InTheWay::PresentingHand) + count(InTheWay::OtherHands) + count(InTheWay::Obstacles);
    if !prepared.limits().is_empty() {
        v1::NoGraspReason::CannotBeHeld
    } else if count(InTheWay::Reach) > obstructed {
        v1::NoGraspReason::OutOfReach
    } else if obstructed > 0 {
        v1::NoGraspReason::GiverInTheWay
    } else {
        v1::NoGraspReason::NotFoundInTime
    }
}

fn sides(evaluation: &Evaluation, frame: ClientFrame) -> Vec<v1::Side> {
    let ClientFrame {
        convention,
        client_from_object,
    } = frame;
    let direction = |d| Some(vector(convention.direction_from_openxr(d)));
    SIDES
        .into_iter()
        .zip(&evaluation.sides)
        .map(|(from, side)| v1::Side {
            client_direction: direction(client_from_object.transform_vector(from)),
            object_direction: direction(from),
            known: side.known,
            valid: side.valid,
            best_score: side.best_score,
        })
        .collect()
}

/// The places of the ratings from the best on; equal ones in their order.
fn ranking(ratings: &[v1::HoldoutRating]) -> Vec<u32> {
    let better = |a: &&v1::HoldoutRating, b: &&v1::HoldoutRating| {
        let by_share = b.valid_share.total_cmp(&a.valid_share);
        let by_score = || b.best_score.total_cmp(&a.best_score);
        match b.receivable.cmp(&a.receivable) {
            Compared::Equal => by_share.then_with(by_score),
            decided => decided,
        }
    };
    let mut ranked: Vec<&v1::HoldoutRating> = ratings.iter().collect();
    ranked.sort_by(better);
    ranked.iter().map(|rating| rating.presenting_hand).collect()
}

fn wire_in_the_way(what: InTheWay) -> v1::InTheWay {
    match what {
        InTheWay::PresentingHand => v1::InTheWay::PresentingHand,
        InTheWay::OtherHands => v1::InTheWay::OtherHands,
        InTheWay::Obstacles => v1::InTheWay::Obstacles,
        InTheWay::Reach => v1::InTheWay::Reach,
        InTheWay::Gravity => v1::InTheWay::Gravity,
        InTheWay::Constraints => v1::InTheWay::Constraints,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_receivable_ones_first_then_by_share_and_score() {
        let rating = |place, receivable, valid_share, best_score| v1::HoldoutRating {
            presenting_hand: place,
            receivable,
            valid_share,
            best_score,
            ..v1::HoldoutRating::default()
        };
        let ratings = [
            rating(0, false, 0.0, 0.0),
            rating(1, true, 0.2, 0.9),
            rating(2, true, 0.5, 0.1),
            rating(3, true, 0.5, 0.4),
            rating(4, true, 0.0, 0.8),
            rating(5, false, 0.0, 0.0),
        ];
        assert_eq!(ranking(&ratings), [3, 2, 1, 4, 0, 5]);
    }
}
