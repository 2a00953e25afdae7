//! Verdicts about a grasp, as messages.

use grasp_proto::v1;
use grasp_synthesis::{
    physical::solids::SolidPart,
    search::verdicts::{Against, Check, Verdict},
};

use super::{ClientFrame, names::wire_digit, vector};

/// A verdict.
pub(crate) fn wire_verdict(verdict: &Verdict, frame: ClientFrame) -> v1::Verdict {
    let ClientFrame {
        convention,
        client_from_object,
    } = frame;
    let digit = verdict.part.and_then(SolidPart::digit);
    v1::Verdict {
        check: wire_check(verdict.check).into(),
        passed: verdict.passed,
        figure: verdict.figure,
        bound: verdict.bound,
        client_position: verdict
            .at
            .map(|at| vector(convention.point_from_openxr(client_from_object.transform_point(at)))),
        digit: digit.map_or(v1::Digit::Unspecified, wire_digit).into(),
        other: verdict
            .against
            .as_ref()
            .map(Against::to_string)
            .unwrap_or_default(),
        description: verdict.description.clone(),
    }
}

fn wire_check(check: Check) -> v1::Check {
    match check {
        Check::JointLimits => v1::Check::JointLimits,
        Check::Penetration => v1::Check::Penetration,
        Check::GiverClearance => v1::Check::GiverClearance,
        Check::ObstacleClearance => v1::Check::ObstacleClearance,
        Check::SelfCollision => v1::Check::SelfCollision,
        Check::Contacts => v1::Check::Contacts,
        Check::Forbidden => v1::Check::Forbidden,
        Check::Closure => v1::Check::Closure,
        Check::Balance => v1::Check::Balance,
        Check::Reach => v1::Check::Reach,
        Check::Constraints => v1::Check::Constraints,
        Check::Banned => v1::Check::Banned,
    }
}
