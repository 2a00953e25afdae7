//! The checks one by one.

use std::fmt::Write as _;

use glam::Vec3;

use super::{Against, Check, Verdict};
use crate::{
    base::stop::{Stop, Stopped},
    model::{
        constraints::Constraints,
        grasp::{Contact, Grasp},
        hand::{
            Digit, DigitAngles, HandPose, Phalanx,
            rig::{AngleRange, Rig},
        },
        holdout::Holdout,
        receiver::Stance,
    },
    physical::{
        grip::{FORBIDDEN_CLEARANCE, GIVER_CLEARANCE, MAX_PENETRATION, PosedHold},
        immobility::BALANCE_TOLERANCE,
        nearest::{Nearest, OBSTACLE_CLEARANCE, nearest_hand, nearest_obstacle, skin_toward_solid},
        scene::Presented,
        solids::{HandSolids, SOFT_CONTACT, SolidPart, TrackedSolids, closest, nearest_parts},
    },
};

/// How far an angle may be beyond its limits, in radians: room for the rounding of clients that count in degrees.
const ANGLE_SLACK: f32 = 1e-3;

/// By how much, in metres, distances may fall short of their bounds: a grasp that was valid loses so much to single precision on
/// its way through a client's frame.
const ROUNDING: f32 = 5e-6;

/// Fewest contacts that hold anything.
const FEWEST_CONTACTS: usize = 2;

/// A posed hand and everything that it is checked against.
pub(super) struct Checks<'a> {
    pub(super) holdout: &'a Holdout,
    pub(super) presented: &'a Presented,
    pub(super) rig: &'a Rig,
    pub(super) solids: &'a HandSolids,
    pub(super) tracked: &'a TrackedSolids,
}

/// The deepest part of a hand: its depth in metres, what it is, and where.
pub(super) type Depth = (f32, SolidPart, Vec3);

/// An angle beyond its limits.
struct Excess {
    by: f32,
    digit: Digit,
    phalanx: Phalanx,
    name: &'static str,
    angle: f32,
    range: AngleRange,
}

impl Verdict {
    fn new(check: Check, passed: bool, description: String) -> Self {
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
}

impl Checks<'_> {
    /// The deepest part in the object; none if no part is in it.
    pub(super) fn depth(&self, stop: Stop<'_>) -> Result<Option<Depth>, Stopped> {
        let mut deepest: Option<Depth> = None;
        for (part, solid) in self.solids.parts() {
            stop.check()?;
            let least = deepest.map_or(0.0, |(depth, ..)| -depth);
            let touch = closest(solid, &self.holdout.object.surface, least);
            if let Some(touch) = touch.filter(|touch| touch.clearance < least) {
                deepest = Some((-touch.clearance, part, touch.point));
            }
        }
        Ok(deepest)
    }

    pub(super) fn nearest_hand(&self) -> Option<Nearest> {
        nearest_hand(self.tracked, self.holdout, self.presented)
    }

    pub(super) fn nearest_obstacle(&self) -> Option<Nearest> {
        nearest_obstacle(self.tracked, self.presented)
    }

    pub(super) fn joint_limits(&self, pose: &HandPose) -> Verdict {
        let digits = Digit::ALL.into_iter().filter(|&digit| self.rig.has(digit));
        let all = digits.flat_map(|digit| self.excesses(digit, pose.digits[digit.index()]));
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
            at: Some(self.solids.phalanges[digit.index()][phalanx.index()].start),
            ..Verdict::new(
                Check::JointLimits,
                passed,
                if passed {
                    "every angle is within its limits".to_owned()
                } else {
                    format!(
                        "{name} of the {part} is {angle:.3} rad; its limits are {min:.3} and {max:.3} rad"
                    )
                },
            )
        }
    }

    fn excesses(&self, digit: Digit, angles: DigitAngles) -> [Excess; 4] {
        let limits = &self.rig.digit(digit).limits;
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

    pub(super) fn self_collision(&self) -> Verdict {
        let Some((clearance, [(part, our), (other, their)])) = nearest_parts(self.solids) else {
            return Verdict::new(
                Check::SelfCollision,
                true,
                "no parts of the hand can meet".to_owned(),
            );
        };
        let distance = clearance - SOFT_CONTACT;
        let place = if distance < 0.0 {
            format!("presses {} into", millimetres(-distance))
        } else {
            format!("is {} from", millimetres(distance))
        };
        Verdict {
            figure: Some(distance),
            bound: Some(-SOFT_CONTACT),
            at: Some(skin_toward_solid(&our, &their)),
            part: Some(part),
            against: Some(Against::Part(other)),
            ..Verdict::new(
                Check::SelfCollision,
                clearance >= -ROUNDING,
                format!(
                    "the {part} {place} the {other}; both yield by {}",
                    millimetres(SOFT_CONTACT)
                ),
            )
        }
    }

    pub(super) fn forbidden(&self) -> Verdict {
        let Some(surface) = self.holdout.object.forbidden_surface() else {
            return Verdict::new(Check::Forbidden, true, "no surface is forbidden".to_owned());
        };
        let mut nearest = None;
        let mut least = f32::INFINITY;
        for (part, solid) in self.solids.parts() {
            let gap = surface.closest_to_capsule(solid, least);
            if let Some(gap) = gap.filter(|gap| gap.gap < least) {
                least = gap.gap;
                nearest = Some((part, gap.position));
            }
        }
        let Some((part, at)) = nearest else {
            return Verdict::new(Check::Forbidden, true, "no surface is forbidden".to_owned());
        };
        let place = if least < 0.0 {
            format!("{} deep in", millimetres(-least))
        } else {
            format!("{} from", millimetres(least))
        };
        Verdict {
            figure: Some(least),
            bound: Some(FORBIDDEN_CLEARANCE),
            at: Some(at),
            part: Some(part),
            ..Verdict::new(
                Check::Forbidden,
                least >= FORBIDDEN_CLEARANCE - ROUNDING,
                format!(
                    "the {part} is {place} a forbidden surface; it must keep {}",
                    millimetres(FORBIDDEN_CLEARANCE)
                ),
            )
        }
    }

    pub(super) fn reach(&self, is_reached: bool, wrist: Vec3) -> Verdict {
        let Stance::At(arm) = self.holdout.stance else {
            return Verdict::new(
                Check::Reach,
                is_reached,
                "where the receiver stands is not given".to_owned(),
            );
        };
        let distance = arm.shoulder.distance(wrist);
        let missing = (distance - arm.upper_arm - arm.forearm).max(0.0);
        let description = if is_reached {
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
            ..Verdict::new(Check::Reach, is_reached, description)
        }
    }
}

pub(super) fn penetration(depth: Option<Depth>) -> Verdict {
    let bound = millimetres(MAX_PENETRATION);
    let (figure, description) = match depth {
        None => (0.0, "no part of the hand is in the object".to_owned()),
        Some((depth, part, _)) => (
            depth,
            format!(
                "the {part} is {} deep in the object; flesh yields by {bound}",
                millimetres(depth)
            ),
        ),
    };
    Verdict {
        figure: Some(figure),
        bound: Some(MAX_PENETRATION),
        at: depth.map(|(.., at)| at),
        part: depth.map(|(_, part, _)| part),
        ..Verdict::new(
            Check::Penetration,
            figure <= MAX_PENETRATION + ROUNDING,
            description,
        )
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
    let bound = if check == Check::ObstacleClearance {
        OBSTACLE_CLEARANCE
    } else {
        GIVER_CLEARANCE
    };
    let place = if distance < 0.0 {
        format!("{} inside", millimetres(-distance))
    } else {
        format!("{} from", millimetres(distance))
    };
    Verdict {
        figure: Some(distance),
        bound: Some(bound),
        at: Some(at),
        part: Some(part),
        against: Some(Against::Barrier(barrier)),
        ..Verdict::new(
            check,
            distance >= bound - ROUNDING,
            format!(
                "the {part} is {place} {barrier}; it must keep {}",
                millimetres(bound)
            ),
        )
    }
}

pub(super) fn contacts(contacts: &[Contact]) -> Verdict {
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
    Verdict {
        figure: Some(count as f32),
        bound: Some(FEWEST_CONTACTS as f32),
        ..Verdict::new(Check::Contacts, count >= FEWEST_CONTACTS, description)
    }
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

pub(super) fn balance(hold: &PosedHold) -> Verdict {
    let residual = hold.balance.residual;
    let [share, most] = [residual, BALANCE_TOLERANCE].map(|share| 100.0 * share);
    Verdict {
        figure: Some(residual),
        bound: Some(BALANCE_TOLERANCE),
        ..Verdict::new(
            Check::Balance,
            residual <= BALANCE_TOLERANCE,
            format!("{share:.1} % of the weight are left unbalanced; up to {most:.1} % may be"),
        )
    }
}

pub(super) fn constraints(constraints: &Constraints, grasp: &Grasp) -> Verdict {
    let passed = constraints.admits(grasp);
    let unmet = [
        (
            constraints.admits_wrist(grasp.pose.frame_from_wrist),
            "reach or approach",
        ),
        (constraints.admits_contacts(&grasp.contacts), "digits"),
        (
            constraints.admits_type(grasp.classification.grasp_type),
            "grasp types",
        ),
        (constraints.admits_comfort(grasp.comfort), "comfort"),
    ];
    let unmet: Vec<&str> = unmet
        .into_iter()
        .filter_map(|(is_met, what)| (!is_met).then_some(what))
        .collect();
    let description = if constraints.is_empty() {
        "there are no constraints".to_owned()
    } else if unmet.is_empty() {
        "all constraints are met".to_owned()
    } else {
        format!("the constraints on {} are not met", unmet.join(", "))
    };
    Verdict::new(Check::Constraints, passed, description)
}

pub(super) fn banned(is_not_banned: bool) -> Verdict {
    let description = if is_not_banned {
        "it is not near a banned grip"
    } else {
        "it is near a banned grip of the object"
    };
    Verdict::new(Check::Banned, is_not_banned, description.to_owned())
}

/// A length in words.
fn millimetres(metres: f32) -> String {
    format!("{:.1} mm", 1000.0 * metres)
}
