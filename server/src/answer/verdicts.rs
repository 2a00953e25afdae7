//! Verdicts: the results of checks, and why there is no grasp, all in one form.

use grasp_proto::v1;
use grasp_synthesis::{
    base::rejection::Rejection,
    model::{grasp::PhysicalMargins, requirements::Check},
    physical::{
        barriers::OBSTACLE_CLEARANCE,
        grip::{GIVER_CLEARANCE, MAX_PENETRATION},
        immobility::BALANCE_TOLERANCE,
    },
    search::{
        current::FailedCheck,
        limits::Limit,
        verdicts::{Against, Verdict},
    },
};

use super::ClientFrame;
use crate::convention::Convention;

/// True if a check measures lengths, which answers have in the convention's unit.
fn measures_length(check: v1::Check) -> bool {
    use v1::Check as C;
    matches!(
        check,
        C::Penetration
            | C::GiverClearance
            | C::OtherHandsClearance
            | C::ObstacleClearance
            | C::SelfCollision
            | C::Forbidden
            | C::Reach
            | C::Width
    )
}

fn measured(
    check: v1::Check,
    passed: bool,
    [value, bound]: [Option<f32>; 2],
    convention: Convention,
) -> v1::Verdict {
    let unit = if measures_length(check) {
        convention
    } else {
        Convention::OpenXr
    };
    let in_unit = |value: f32| unit.length_from_openxr(value);
    v1::Verdict {
        check: check.into(),
        passed,
        value: value.map(in_unit),
        bound: bound.map(in_unit),
        ..v1::Verdict::default()
    }
}

pub(crate) fn wire_verdict(verdict: &Verdict, frame: ClientFrame) -> v1::Verdict {
    let (check, numbers) = (wire_check(verdict.check), [verdict.figure, verdict.bound]);
    let against = verdict.against.as_ref();
    v1::Verdict {
        r#where: verdict.at.map(|at| frame.point(at)),
        subject: against.map(Against::to_string).unwrap_or_default(),
        description: verdict.description.clone(),
        ..measured(check, verdict.passed, numbers, frame.convention)
    }
}

pub(super) fn wire_failed_check(failed: &FailedCheck, convention: Convention) -> v1::Verdict {
    let check = wire_check(failed.check);
    let numbers = if check == v1::Check::Reach {
        // How much farther the arm would have to reach: not at all if it only bends too far.
        let numbers = failed.figure.zip(failed.bound);
        let missing = numbers.map_or(0.0, |(distance, most)| distance - most);
        [Some(missing), Some(0.0)]
    } else {
        [failed.figure, failed.bound]
    };
    v1::Verdict {
        description: failed.to_string(),
        ..measured(check, false, numbers, convention)
    }
}

/// A limit that keeps one hand from holding an object.
pub(super) fn wire_limit(limit: &Limit, convention: Convention) -> v1::Verdict {
    let check = wire_check(limit.check);
    // Shares have no unit, though verdicts of the same checks have lengths.
    let convention = match limit.check {
        Check::Forbidden | Check::ObstacleClearance => Convention::OpenXr,
        _ => convention,
    };
    v1::Verdict {
        description: limit.to_string(),
        ..measured(check, false, [Some(limit.value), limit.bound], convention)
    }
}

pub(super) fn wire_margins(margins: &PhysicalMargins, convention: Convention) -> Vec<v1::Verdict> {
    use v1::Check as C;
    let margins = [
        (C::Balance, Some(margins.residual), Some(BALANCE_TOLERANCE)),
        // The bound depends on the contacts.
        (C::Closure, Some(margins.epsilon), None),
        (C::Penetration, Some(margins.penetration), Some(MAX_PENETRATION)),
        (C::GiverClearance, margins.giver_clearance, Some(GIVER_CLEARANCE)),
        (
            C::ObstacleClearance,
            margins.obstacle_clearance,
            Some(OBSTACLE_CLEARANCE),
        ),
    ];
    let known = margins.into_iter().filter(|(_, value, _)| value.is_some());
    known
        .map(|(check, value, bound)| measured(check, true, [value, bound], convention))
        .collect()
}

/// Gives the margins of a grasp that need not be valid the results and bounds of its verdicts.
pub(crate) fn settle_margins(grasp: &mut v1::Grasp, verdicts: &[v1::Verdict]) {
    for margin in &mut grasp.margins {
        if let Some(verdict) = verdicts.iter().find(|verdict| verdict.check == margin.check) {
            margin.passed = verdict.passed;
            margin.bound = verdict.bound;
        }
    }
}

pub(crate) fn wire_rejection(rejection: Rejection) -> v1::Check {
    match rejection {
        Rejection::NoContacts => v1::Check::Contacts,
        Rejection::NoThumb => v1::Check::Thumb,
        Rejection::NoThumbEarlyStop => v1::Check::ThumbEarly,
        Rejection::NoFingers => v1::Check::Fingers,
        Rejection::PalmCollision => v1::Check::PalmCollision,
        Rejection::FingerCollision => v1::Check::FingerCollision,
        Rejection::UnwantedContact => v1::Check::Forbidden,
        Rejection::NotImmobilizing => v1::Check::Balance,
        Rejection::UnmetRequirement => v1::Check::Requirements,
    }
}

pub(crate) fn wire_check(check: Check) -> v1::Check {
    match check {
        Check::JointLimits => v1::Check::JointLimits,
        Check::Penetration => v1::Check::Penetration,
        Check::GiverClearance => v1::Check::GiverClearance,
        Check::OtherHandsClearance => v1::Check::OtherHandsClearance,
        Check::ObstacleClearance => v1::Check::ObstacleClearance,
        Check::SelfCollision => v1::Check::SelfCollision,
        Check::Contacts => v1::Check::Contacts,
        Check::Forbidden => v1::Check::Forbidden,
        Check::Closure => v1::Check::Closure,
        Check::Balance => v1::Check::Balance,
        Check::Reach => v1::Check::Reach,
        Check::Approach | Check::Digits | Check::GraspType | Check::Comfort | Check::Requirements => {
            v1::Check::Requirements
        }
        Check::Banned => v1::Check::ForbiddenGrip,
        Check::Score => v1::Check::Score,
        Check::Mass => v1::Check::Mass,
        Check::Torque => v1::Check::Torque,
        Check::Width => v1::Check::Width,
        Check::Holdable => v1::Check::Holdable,
        Check::Time => v1::Check::Time,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn failed(check: Check, figure: Option<f32>, bound: Option<f32>) -> v1::Verdict {
        let failed = FailedCheck { check, figure, bound };
        wire_failed_check(&failed, Convention::Unreal)
    }

    fn numbers(verdict: &v1::Verdict) -> (v1::Check, Option<f32>, Option<f32>) {
        (verdict.check(), verdict.value, verdict.bound)
    }

    #[test]
    fn only_lengths_are_in_the_unit_of_the_convention() {
        let near = failed(Check::GiverClearance, Some(-0.01), Some(0.001));
        assert!(!near.passed && near.description.contains("10.0 mm"), "{near:?}");
        let slipping = failed(Check::Balance, Some(0.5), Some(0.02));
        let limit = |check, value, bound| wire_limit(&Limit { check, value, bound }, Convention::Unreal);
        // Shares, where verdicts have distances.
        let shares = [Check::Forbidden, Check::ObstacleClearance].map(|check| limit(check, 0.75, None));
        for (verdict, check, value, bound) in [
            (&near, v1::Check::GiverClearance, -1.0, Some(0.1)),
            (&slipping, v1::Check::Balance, 0.5, Some(0.02)),
            (
                &limit(Check::Width, 0.25, Some(0.125)),
                v1::Check::Width,
                25.0,
                Some(12.5),
            ),
            (
                &limit(Check::Mass, 80.0, Some(70.0)),
                v1::Check::Mass,
                80.0,
                Some(70.0),
            ),
            (&shares[0], v1::Check::Forbidden, 0.75, None),
            (&shares[1], v1::Check::ObstacleClearance, 0.75, None),
        ] {
            assert_eq!(numbers(verdict), (check, Some(value), bound));
        }
    }

    #[test]
    fn a_wrist_out_of_reach_says_how_much_farther_the_arm_would_have_to_reach() {
        let away = failed(Check::Reach, Some(0.75), Some(0.5));
        assert_eq!(numbers(&away), (v1::Check::Reach, Some(25.0), Some(0.0)));
        let bent = failed(Check::Reach, None, None);
        assert_eq!(numbers(&bent), (v1::Check::Reach, Some(0.0), Some(0.0)));
    }

    #[test]
    fn margins_have_measured_values_and_settle_by_verdicts() {
        use v1::Check as C;
        let margins = PhysicalMargins {
            residual: 0.01,
            epsilon: 0.1,
            penetration: 0.001,
            giver_clearance: Some(0.0005),
            obstacle_clearance: None,
        };
        let mut grasp = v1::Grasp {
            margins: wire_margins(&margins, Convention::Unreal),
            ..v1::Grasp::default()
        };
        let checks: Vec<C> = grasp.margins.iter().map(v1::Verdict::check).collect();
        assert_eq!(
            checks,
            [C::Balance, C::Closure, C::Penetration, C::GiverClearance]
        );
        assert_eq!(grasp.margin(v1::Check::Penetration), Some(0.1));
        assert!(grasp.margins.iter().all(|margin| margin.passed));
        settle_margins(
            &mut grasp,
            &[failed(Check::GiverClearance, Some(0.0005), Some(0.001))],
        );
        let passed: Vec<bool> = grasp.margins.iter().map(|margin| margin.passed).collect();
        assert_eq!(passed, [true, true, true, false]);
    }
}
