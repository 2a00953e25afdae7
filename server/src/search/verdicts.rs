//! Work on a holdout other than a search for its grasp: verdicts about a client's own grasp and a valid one near it, and ratings of
//! poses of the giver's hand by how many of the known grips remain valid.

use std::time::Instant;

use grasp_proto::v1;
use grasp_synthesis::{
    base::{clock::Clock as _, stop::Stop},
    model::{hand::kinematics::farthest_joint, requirements::Check, score::Score},
    physical::barriers::Barrier,
    search::{
        current::{HandWay, nearest_grasp},
        evaluation::{self, Evaluation, HINDRANCES, SIDES},
        scene::Scene,
        verdicts::{self, Against, Verdict},
    },
};

use super::{
    job::FindJob,
    prepared::{Answered, HandSearch, PreparedJob},
    slices::{HandPlace, Progress},
};
use crate::{
    answer::{settle_margins, wire_check, wire_grasp, wire_motion, wire_verdict},
    call::SearchSummary,
    convention::Convention,
    error::ServiceError,
    executor::Workers,
    validate::{GivenGrasp, GiverHand},
};

/// Judges a grasp by the checks of a search with its hand. If it is not valid, searches for a valid one near it on request.
/// `warnings` are the repairs of the grasp.
pub(crate) fn judge(
    find: FindJob,
    grasp: &GivenGrasp,
    find_nearest: bool,
    mut warnings: Vec<String>,
    workers: Workers<'_>,
    stop: Stop<'_>,
) -> Result<Answered<v1::ValidateGraspResponse>, ServiceError> {
    let start = Instant::now();
    let prepared = find.prepare()?;
    let frame = prepared.frame();
    warnings.extend(prepared.warnings().cloned());
    let HandSearch { hand, settings, .. } = &prepared.hands[0];
    let task = prepared.task(0);
    let pose = grasp.at_object(task.rig, frame.client_from_object);
    let mut judgement = verdicts::judge(task, &settings.query, &pose, stop)?;
    let nearest = if find_nearest && !judgement.is_valid() {
        let is_over = || prepared.now() >= prepared.budget;
        // A search is due if nothing known is valid.
        nearest_grasp(task, settings, &pose, Stop::when(&is_over))
            .or_else(|| prepared.search(workers, stop, &Progress::default()).outcome.grasp)
    } else {
        None
    };
    stop.check()?;
    let ended = Instant::now();
    let way = nearest
        .as_ref()
        .map(|nearest| HandWay::between(&Scene::new(task, settings), &pose, &nearest.pose));
    for verdict in &mut judgement.verdicts {
        name_obstacle(verdict, &prepared.query.obstacle_places);
    }
    let verdicts = judgement.verdicts.iter();
    let verdicts: Vec<v1::Verdict> = verdicts.map(|verdict| wire_verdict(verdict, frame)).collect();
    let mut seen = wire_grasp(&judgement.grasp, hand, frame);
    settle_margins(&mut seen, &verdicts);
    // Largest distance of the rig's joints from tracked ones.
    let joint_error = match grasp {
        GivenGrasp::AtObject(_) => None,
        GivenGrasp::Tracked(joints) => {
            let joints = joints.transformed(frame.client_from_object.inverse());
            let metres = farthest_joint(task.rig, &pose, &joints);
            Some(frame.convention.length_from_openxr(metres))
        }
    };
    let valid = judgement.is_valid();
    let failed = verdicts
        .iter()
        .find(|verdict| !verdict.passed)
        .map(v1::Verdict::check);
    Ok(Answered {
        response: v1::ValidateGraspResponse {
            valid,
            verdicts,
            grasp: Some(seen),
            joint_error,
            nearest: nearest.as_ref().map(|nearest| wire_grasp(nearest, hand, frame)),
            nearest_motion: way.map(|way| wire_motion(&way, frame.convention)),
            warnings,
        },
        ended,
        summary: SearchSummary {
            outcome: if valid { "VALID" } else { "NOT_VALID" },
            attempts: 0,
            time: ended - start,
            failed_check: failed,
        },
        new_grip: None,
    })
}

/// Names an obstacle by its place in the request, where one entry may be several obstacles.
fn name_obstacle(verdict: &mut Verdict, places: &[usize]) {
    if let Some(Against::Barrier(solid @ Barrier::Obstacle(number))) = verdict.against {
        let sent = Barrier::Obstacle(places[number]);
        verdict.description = verdict.description.replace(&solid.to_string(), &sent.to_string());
        verdict.against = Some(Against::Barrier(sent));
    }
}

/// Rates a holdout, and the same with each other hand in place of the giver's. Each giver has the same part of the budget; grips
/// that are unchecked by then do not count.
pub(crate) fn rate(
    find: &FindJob,
    other_presenting_hands: Vec<GiverHand>,
    workers: Workers<'_>,
    stop: Stop<'_>,
) -> Result<Answered<v1::EvaluateHoldoutResponse>, ServiceError> {
    let start = Instant::now();
    let budget = find.budget;
    let givers = 1 + other_presenting_hands.len() as u32;
    let mut response = v1::EvaluateHoldoutResponse::default();
    let mut attempts = 0;
    let first = find.query.presenting_hand.clone();
    let hands = std::iter::once(first).chain(other_presenting_hands.into_iter().map(Some));
    for (place, presenting_hand) in (0..).zip(hands) {
        let mut of_giver = find.clone();
        of_giver.query.presenting_hand = presenting_hand;
        of_giver.budget = budget * (place + 1) / givers;
        of_giver.patience = of_giver.budget;
        let prepared = of_giver.prepare()?;
        if place == 0 {
            response.atlases = atlases(&prepared);
        }
        for warning in prepared.warnings() {
            if !response.warnings.contains(warning) {
                response.warnings.push(warning.clone());
            }
        }
        response
            .ratings
            .push(rating(place, &prepared, workers, stop, &mut attempts));
        stop.check()?;
    }
    rank(&mut response.ratings);
    let ended = Instant::now();
    Ok(Answered {
        ended,
        summary: SearchSummary {
            outcome: if response.ratings.iter().any(is_receivable) {
                "RECEIVABLE"
            } else {
                "NOT_RECEIVABLE"
            },
            attempts,
            time: ended - start,
            failed_check: None,
        },
        response,
        new_grip: None,
    })
}

fn atlases(prepared: &PreparedJob) -> Vec<v1::Atlas> {
    let knows = |place: &HandPlace| prepared.hands[*place].settings.known.atlas.is_some();
    let places = (0..prepared.hands.len()).filter(knows);
    places.filter_map(|place| prepared.atlas_used(place)).collect()
}

/// The rating of one giver. Without a valid known grip, a search decides, whose attempts are added to others.
fn rating(
    presenting_hand: u32,
    prepared: &PreparedJob,
    workers: Workers<'_>,
    stop: Stop<'_>,
    attempts: &mut u64,
) -> v1::HoldoutRating {
    let is_over = || stop.is_over() || prepared.now() >= prepared.budget;
    let hands = prepared.hands.iter().enumerate();
    let evaluation = hands
        .map(|(place, hand)| evaluation::evaluate(prepared.task(place), &hand.settings, Stop::when(&is_over)))
        .fold(Evaluation::default(), |sum, hand| sum.with(&hand));
    let valid = evaluation.valid();
    let mut found = None;
    if valid == 0 && !is_over() {
        let outcome = prepared.search(workers, stop, &Progress::default()).outcome;
        *attempts += outcome.report.attempts;
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
    v1::HoldoutRating {
        presenting_hand,
        no_grasp: no_grasp.into(),
        best_score: found_score.unwrap_or_default().max(evaluation.best_score()),
        sides: sides(&evaluation, prepared.frame().convention),
        hindrances: hindrances.filter(|hindrance| hindrance.count > 0).collect(),
    }
}

/// The known reason why there is no grasp.
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
    ratings.sort_by(|a, b| {
        let by_receivable = is_receivable(b).cmp(&is_receivable(a));
        by_receivable
            .then_with(|| valid_share(b).total_cmp(&valid_share(a)))
            .then_with(|| b.best_score.total_cmp(&a.best_score))
    });
}

fn is_receivable(rating: &v1::HoldoutRating) -> bool {
    rating.no_grasp() == v1::Check::Unspecified
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
        let rating = |(place, (receivable, valid, best_score))| {
            let no_grasp = [v1::Check::Time, v1::Check::Unspecified][usize::from(receivable)];
            let side = |known, valid| v1::ObjectSide {
                known,
                valid,
                ..v1::ObjectSide::default()
            };
            v1::HoldoutRating {
                presenting_hand: place,
                no_grasp: no_grasp.into(),
                best_score,
                sides: vec![side(6, valid), side(4, 0)],
                ..v1::HoldoutRating::default()
            }
        };
        let rated = [
            (false, 0, 0.0),
            (true, 2, 0.9),
            (true, 5, 0.1),
            (true, 5, 0.4),
            (true, 0, 0.8),
            (false, 0, 0.0),
        ];
        let mut ratings: Vec<_> = (0..).zip(rated).map(rating).collect();
        rank(&mut ratings);
        let order: Vec<u32> = ratings.iter().map(|rating| rating.presenting_hand).collect();
        assert_eq!(order, [3, 2, 1, 4, 0, 5]);
    }
}
