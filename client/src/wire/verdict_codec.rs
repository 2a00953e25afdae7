//! Grasps to check, and verdicts.

use grasp_proto::v1;

use super::{
    Malformed, each,
    geometry_codec::{duration_from_wire, vector_from_wire},
    hand_codec::{digit_from_wire, hand_angles_to_wire, hand_at_object_to_wire, hand_joints_to_wire},
    required,
    search_codec::{find_request_to_wire, grasp_from_wire},
    standing_codec::way_from_wire,
};
use crate::verdict::{Check, GraspToValidate, ValidateAnswer, ValidateRequest, Verdict};

pub(crate) fn validate_request_to_wire(request: &ValidateRequest) -> v1::ValidateGraspRequest {
    use v1::grasp_to_validate::Form;
    let form = match &request.grasp {
        GraspToValidate::Hand(hand) => Form::Hand(hand_at_object_to_wire(hand)),
        GraspToValidate::Angles(angles) => Form::Angles(hand_angles_to_wire(angles)),
        GraspToValidate::Joints(joints) => Form::Joints(hand_joints_to_wire(joints)),
    };
    v1::ValidateGraspRequest {
        holdout: Some(find_request_to_wire(&request.holdout)),
        grasp: Some(v1::GraspToValidate { form: Some(form) }),
        find_nearest: request.find_nearest,
    }
}

pub(crate) fn validate_answer_from_wire(
    answer: v1::ValidateGraspResponse,
) -> Result<ValidateAnswer, Malformed> {
    let grasp =
        |field: &str, grasp: v1::Grasp| grasp_from_wire(grasp).map_err(|malformed| malformed.within(field));
    let check_time = required("check_time", answer.check_time)?;
    Ok(ValidateAnswer {
        valid: answer.valid,
        verdicts: each("verdicts", answer.verdicts, verdict_from_wire)?,
        grasp: grasp("grasp", required("grasp", answer.grasp)?)?,
        farthest_joint: answer.farthest_joint,
        nearest: answer
            .nearest
            .map(|nearest| grasp("nearest", nearest))
            .transpose()?,
        way_to_nearest: answer.way_to_nearest.map(way_from_wire),
        warnings: answer.warnings,
        check_time: duration_from_wire("check_time", check_time)?,
    })
}

fn verdict_from_wire(verdict: v1::Verdict) -> Result<Verdict, Malformed> {
    Ok(Verdict {
        check: match v1::Check::try_from(verdict.check) {
            Ok(v1::Check::JointLimits) => Check::JointLimits,
            Ok(v1::Check::Penetration) => Check::Penetration,
            Ok(v1::Check::GiverClearance) => Check::GiverClearance,
            Ok(v1::Check::ObstacleClearance) => Check::ObstacleClearance,
            Ok(v1::Check::SelfCollision) => Check::SelfCollision,
            Ok(v1::Check::Contacts) => Check::Contacts,
            Ok(v1::Check::Forbidden) => Check::Forbidden,
            Ok(v1::Check::Closure) => Check::Closure,
            Ok(v1::Check::Balance) => Check::Balance,
            Ok(v1::Check::Reach) => Check::Reach,
            Ok(v1::Check::Constraints) => Check::Constraints,
            Ok(v1::Check::Banned) => Check::Banned,
            Ok(v1::Check::Unspecified) | Err(_) => Check::Unrecognised,
        },
        passed: verdict.passed,
        figure: verdict.figure,
        bound: verdict.bound,
        client_position: verdict.client_position.map(vector_from_wire),
        digit: digit_from_wire("digit", verdict.digit)?,
        other: Some(verdict.other).filter(|other| !other.is_empty()),
        description: verdict.description,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checks_of_newer_servers_are_unrecognised_and_empty_texts_none() {
        let wire = v1::Verdict {
            check: 99,
            passed: true,
            figure: Some(0.5),
            digit: v1::Digit::Ring.into(),
            ..v1::Verdict::default()
        };
        let verdict = verdict_from_wire(wire).unwrap();
        assert_eq!(verdict.check, Check::Unrecognised);
        assert_eq!(
            (verdict.figure, verdict.bound, verdict.other),
            (Some(0.5), None, None)
        );
        assert_eq!(verdict.digit, Some(crate::Digit::Ring));
    }

    #[test]
    fn answers_without_grasp_are_malformed() {
        let answer = v1::ValidateGraspResponse {
            check_time: Some(prost_types::Duration::default()),
            ..v1::ValidateGraspResponse::default()
        };
        assert_eq!(
            validate_answer_from_wire(answer),
            Err(Malformed::missing("grasp"))
        );
    }
}
