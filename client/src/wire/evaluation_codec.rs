//! Holdouts to rate, and ratings.

use grasp_proto::v1;

use super::{
    Malformed, each,
    geometry_codec::{duration_from_wire, vector_from_wire},
    hand_codec::presenting_hand_to_wire,
    required,
    search_codec::find_request_to_wire,
    standing_codec::no_grasp_from_wire,
};
use crate::evaluation::{EvaluateAnswer, EvaluateRequest, Hindrance, HoldoutRating, InTheWay, Side};

pub(crate) fn evaluate_request_to_wire(request: &EvaluateRequest) -> v1::EvaluateHoldoutRequest {
    v1::EvaluateHoldoutRequest {
        holdout: Some(find_request_to_wire(&request.holdout)),
        other_presenting_hands: request
            .other_presenting_hands
            .iter()
            .map(presenting_hand_to_wire)
            .collect(),
    }
}

pub(crate) fn evaluate_answer_from_wire(
    answer: v1::EvaluateHoldoutResponse,
) -> Result<EvaluateAnswer, Malformed> {
    Ok(EvaluateAnswer {
        ratings: each("ratings", answer.ratings, rating_from_wire)?,
        ranking: answer.ranking,
        atlas_stamps: answer.atlas_stamps,
        time: duration_from_wire("time", required("time", answer.time)?)?,
        warnings: answer.warnings,
    })
}

fn rating_from_wire(rating: v1::HoldoutRating) -> Result<HoldoutRating, Malformed> {
    Ok(HoldoutRating {
        presenting_hand: rating.presenting_hand,
        receivable: rating.receivable,
        reason: no_grasp_from_wire(rating.reason),
        known: rating.known,
        valid: rating.valid,
        valid_share: rating.valid_share,
        best_score: rating.best_score,
        sides: each("sides", rating.sides, side_from_wire)?,
        hindrances: rating.hindrances.into_iter().map(hindrance_from_wire).collect(),
    })
}

fn side_from_wire(side: v1::Side) -> Result<Side, Malformed> {
    Ok(Side {
        client_direction: vector_from_wire(required("client_direction", side.client_direction)?),
        object_direction: vector_from_wire(required("object_direction", side.object_direction)?),
        known: side.known,
        valid: side.valid,
        best_score: side.best_score,
    })
}

fn hindrance_from_wire(hindrance: v1::Hindrance) -> Hindrance {
    Hindrance {
        what: match v1::InTheWay::try_from(hindrance.what) {
            Ok(v1::InTheWay::PresentingHand) => InTheWay::PresentingHand,
            Ok(v1::InTheWay::OtherHands) => InTheWay::OtherHands,
            Ok(v1::InTheWay::Obstacles) => InTheWay::Obstacles,
            Ok(v1::InTheWay::Reach) => InTheWay::Reach,
            Ok(v1::InTheWay::Gravity) => InTheWay::Gravity,
            Ok(v1::InTheWay::Constraints) => InTheWay::Constraints,
            Ok(v1::InTheWay::Unspecified) | Err(_) => InTheWay::Unrecognised,
        },
        share: hindrance.share,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_side_without_direction_is_malformed() {
        let answer = v1::EvaluateHoldoutResponse {
            ratings: vec![v1::HoldoutRating {
                sides: vec![v1::Side::default()],
                ..v1::HoldoutRating::default()
            }],
            time: Some(prost_types::Duration::default()),
            ..v1::EvaluateHoldoutResponse::default()
        };
        let malformed = evaluate_answer_from_wire(answer).unwrap_err();
        assert_eq!(
            malformed,
            Malformed::missing("ratings[0].sides[0].client_direction")
        );
    }

    #[test]
    fn reasons_and_hindrances_of_newer_servers_are_unrecognised() {
        let rating = rating_from_wire(v1::HoldoutRating {
            reason: 77,
            hindrances: vec![v1::Hindrance { what: 77, share: 0.5 }],
            ..v1::HoldoutRating::default()
        })
        .unwrap();
        assert_eq!(rating.reason, Some(crate::standing::NoGraspReason::Unrecognised));
        assert_eq!(rating.hindrances[0].what, InTheWay::Unrecognised);
    }
}
