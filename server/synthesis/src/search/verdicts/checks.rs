//! The checks one by one, in words.

use std::fmt::Write as _;

use glam::Vec3;

use super::{Against, Verdict};
use crate::{
    model::{
        hand::{
            Digit, DigitAngles, HandPose, Phalanx,
            rig::{AngleRange, Rig},
        },
        requirements::Check,
    },
    physical::{
        barriers::Nearest,
        grip::{FEWEST_CONTACTS, FORBIDDEN_CLEARANCE, PosedHold},
        solids::{HandSolids, SOFT_CONTACT, SolidPart},
    },
    search::reading::{self, ClosestParts, Deepest, Held, Measure, NearestForbidden, Reading},
};

/// How far an angle may be beyond its limits, in radians: room for the rounding of clients that count in degrees.
const ANGLE_SLACK: f32 = 1e-3;

impl Verdict {
    pub(super) fn new(check: Check, passed: bool, description: String) -> Self {
        Self {
            check,
            passed,
            figure: None,
            bound: None,
            at: None,
            part: None,
            against: None,
            description,
        }
    }

    fn measured(check: Check, measure: Measure, description: String) -> Self {
        Self {
            figure: Some(measure.figure),
            bound: Some(measure.bound),
            ..Self::new(check, measure.passed, description)
        }
    }
}

pub(super) fn self_collision(parts: Option<ClosestParts>) -> Verdict {
    let Some(parts) = parts else {
        return Verdict::new(
            Check::SelfCollision,
            true,
            "no parts of the hand can meet".to_owned(),
        );
    };
    let ClosestParts {
        distance,
        rest_overlap,
        part,
        other,
        at,
    } = parts;
    let place = if distance < 0.0 && rest_overlap > 0.0 {
        format!("presses {} deeper than at rest into", millimetres(-distance))
    } else if distance < 0.0 {
        format!("presses {} into", millimetres(-distance))
    } else {
        format!("is {} from", millimetres(distance))
    };
    let description = format!(
        "the {part} {place} the {other}; both yield by {}",
        millimetres(SOFT_CONTACT)
    );
    Verdict {
        at: Some(at),
        part: Some(part),
        against: Some(Against::Part(other)),
        ..Verdict::measured(Check::SelfCollision, parts.measure(), description)
    }
}

pub(super) fn forbidden(nearest: Option<NearestForbidden>) -> Verdict {
    let Some(nearest) = nearest else {
        return Verdict::new(Check::Forbidden, true, "no surface is forbidden".to_owned());
    };
    let NearestForbidden { distance, part, at } = nearest;
    let place = if distance < 0.0 {
        format!("{} deep in", millimetres(-distance))
    } else {
        format!("{} from", millimetres(distance))
    };
    let description = format!(
        "the {part} is {place} a forbidden surface; it must keep {}",
        millimetres(FORBIDDEN_CLEARANCE)
    );
    Verdict {
        at: Some(at),
        part: Some(part),
        ..Verdict::measured(Check::Forbidden, nearest.measure(), description)
    }
}

/// Whether the arm reaches the wrist, and the requirements let it. The figure is how much too long the way from the shoulder is.
pub(super) fn reach([arm, constrained]: [Option<Measure>; 2], wrist: Vec3) -> Verdict {
    let is_failed = |reach: &Measure| !reach.passed;
    let decisive = arm.filter(is_failed).or(constrained.filter(is_failed));
    let Some(reach) = decisive.or(arm).or(constrained) else {
        return Verdict::new(
            Check::Reach,
            true,
            "where the receiver stands is not given".to_owned(),
        );
    };
    let distance = reach.figure;
    let missing = (distance - reach.bound).max(0.0);
    let description = if reach.passed {
        format!("the arm reaches the wrist, {distance:.3} m from the shoulder")
    } else if missing > 0.0 {
        format!(
            "the wrist is {distance:.3} m from the shoulder, {} beyond the arm's reach",
            millimetres(missing)
        )
    } else {
        "the arm is long enough, but wrist or elbow would bend too far, or the arm would go through something"
            .to_owned()
    };
    Verdict {
        figure: Some(missing),
        bound: Some(0.0),
        at: Some(wrist),
        ..Verdict::new(Check::Reach, reach.passed, description)
    }
}

pub(super) fn penetration(deepest: Option<Deepest>) -> Verdict {
    let measure = Deepest::measure(deepest.as_ref());
    let description = match deepest {
        None => "no part of the hand is in the object".to_owned(),
        Some(Deepest { depth, part, .. }) => format!(
            "the {part} is {} deep in the object; flesh yields by {}",
            millimetres(depth),
            millimetres(measure.bound)
        ),
    };
    Verdict {
        at: deepest.map(|deepest| deepest.at),
        part: deepest.map(|deepest| deepest.part),
        ..Verdict::measured(Check::Penetration, measure, description)
    }
}

pub(super) fn clearance(check: Check, nearest: Option<Nearest>) -> Verdict {
    let Some(nearest) = nearest else {
        return Verdict::new(check, true, "there is nothing to keep clear of".to_owned());
    };
    let Nearest {
        distance,
        part,
        at,
        barrier,
    } = nearest;
    let measure = reading::clearance(&nearest);
    let place = if distance < 0.0 {
        format!("{} inside", millimetres(-distance))
    } else {
        format!("{} from", millimetres(distance))
    };
    let description = format!(
        "the {part} is {place} {barrier}; it must keep {}",
        millimetres(measure.bound)
    );
    Verdict {
        at: Some(at),
        part: Some(part),
        against: Some(Against::Barrier(barrier)),
        ..Verdict::measured(check, measure, description)
    }
}

pub(super) fn contacts(held: &Held<'_>) -> Verdict {
    let contacts = held.contacts;
    let count = contacts.len();
    let mut description = match count {
        0 => "nothing touches the object".to_owned(),
        1 => "there is 1 contact: ".to_owned(),
        _ => format!("there are {count} contacts: "),
    };
    let mut names: Vec<String> = Vec::new();
    for contact in contacts {
        let name = match contact.part.digit() {
            Some(digit) => SolidPart::Phalanx(digit, Phalanx::First).to_string(),
            None => SolidPart::Palm.to_string(),
        };
        if !names.contains(&name) {
            names.push(name);
        }
    }
    description.push_str(&names.join(", "));
    if count < FEWEST_CONTACTS {
        let _ = write!(description, "; {FEWEST_CONTACTS} are needed");
    }
    Verdict::measured(Check::Contacts, held.contacts(), description)
}

pub(super) fn closure(hold: &PosedHold) -> Verdict {
    let PosedHold { epsilon, .. } = hold;
    let description = match hold.required {
        None => format!(
            "the object hangs in the fingers, which it would have to be lifted out of: {:.1} times as high as required",
            hold.relative_closure
        ),
        Some(required) if *epsilon <= 0.0 => {
            format!("a push from some side meets no resistance: epsilon is 0; {required:.4} is required")
        }
        Some(required) => format!("epsilon is {epsilon:.4}; {required:.4} is required"),
    };
    Verdict {
        figure: Some(*epsilon),
        bound: hold.required,
        ..Verdict::new(Check::Closure, hold.is_enclosed, description)
    }
}

pub(super) fn balance(held: &Held<'_>) -> Verdict {
    let measure = held.balance();
    let [share, most] = [measure.figure, measure.bound].map(|share| 100.0 * share);
    Verdict::measured(
        Check::Balance,
        measure,
        format!("{share:.1} % of the weight are left unbalanced; up to {most:.1} % may be"),
    )
}

pub(super) fn requirements(reading: &Reading<'_>, held: &Held<'_>) -> Verdict {
    let unmet: Vec<&str> = [
        (reading.is_approach_admitted(), "approach"),
        (held.are_digits_admitted(), "digits"),
        (held.is_type_admitted(held.classification()), "grasp types"),
        (held.is_comfort_admitted(), "comfort"),
    ]
    .into_iter()
    .filter_map(|(is_met, what)| (!is_met).then_some(what))
    .collect();
    let description = if reading.around.requirements.is_empty() {
        "nothing more is required".to_owned()
    } else if unmet.is_empty() {
        "all requirements are met".to_owned()
    } else {
        format!("the requirements on {} are not met", unmet.join(", "))
    };
    Verdict::new(Check::Requirements, unmet.is_empty(), description)
}

pub(super) fn banned(is_not_banned: bool) -> Verdict {
    let description = if is_not_banned {
        "it is not near a forbidden grip"
    } else {
        "it is near a forbidden grip of the object"
    };
    Verdict::new(Check::Banned, is_not_banned, description.to_owned())
}

/// An angle beyond its limits.
struct Excess {
    by: f32,
    digit: Digit,
    phalanx: Phalanx,
    name: &'static str,
    angle: f32,
    range: AngleRange,
}

/// The largest excess of the hand's angles: searches keep the limits as they bend digits, and requests with current grasps are
/// refused.
pub(super) fn joint_limits(rig: &Rig, pose: &HandPose, solids: &HandSolids) -> Verdict {
    let digits = Digit::ALL.into_iter().filter(|&digit| rig.has(digit));
    let all = digits.flat_map(|digit| excesses(rig, digit, pose.digits[digit.index()]));
    let worst = all.max_by(|a, b| a.by.total_cmp(&b.by));
    let Some(worst) = worst else {
        return Verdict::new(Check::JointLimits, true, "the hand has no digits".to_owned());
    };
    let passed = worst.by <= ANGLE_SLACK;
    let Excess {
        by,
        digit,
        phalanx,
        name,
        angle,
        range: AngleRange { min, max },
    } = worst;
    let part = SolidPart::Phalanx(digit, phalanx);
    Verdict {
        figure: Some(by),
        bound: Some(ANGLE_SLACK),
        part: Some(part),
        at: Some(solids.phalanges[digit.index()][phalanx.index()].start),
        ..Verdict::new(
            Check::JointLimits,
            passed,
            if passed {
                "every angle is within its limits".to_owned()
            } else {
                format!("{name} of the {part} is {angle:.3} rad; its limits are {min:.3} and {max:.3} rad")
            },
        )
    }
}

fn excesses(rig: &Rig, digit: Digit, angles: DigitAngles) -> [Excess; 4] {
    let limits = &rig.digit(digit).limits;
    let excess = |name, phalanx, angle: f32, range: AngleRange| Excess {
        by: (range.min - angle).max(angle - range.max).max(0.0),
        digit,
        phalanx,
        name,
        angle,
        range,
    };
    [
        excess("base_yaw", Phalanx::First, angles.base_yaw, limits.base_yaw),
        excess("base_pitch", Phalanx::First, angles.base_pitch, limits.base_pitch),
        excess(
            "second_pitch",
            Phalanx::Second,
            angles.second_pitch,
            limits.second_pitch,
        ),
        excess(
            "third_pitch",
            Phalanx::Third,
            angles.third_pitch,
            limits.third_pitch,
        ),
    ]
}

/// A length in words.
fn millimetres(metres: f32) -> String {
    format!("{:.1} mm", 1000.0 * metres)
}
