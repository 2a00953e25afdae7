//! Verdicts about a hand that a client posed: every check of `PHYSICAL` validity with its figure, in words.

use std::fmt::{self, Write as _};

use glam::Vec3;

use super::{
    reading::{self, Held, Measure, NearestPart, Reading, depth},
    scene::Task,
    settings::Query,
};
use crate::{
    base::stop::{Stop, Stopped},
    model::{
        grasp::Grasp,
        hand::{
            Digit, HandPose, Phalanx,
            rig::{AngleRange, Rig},
        },
        requirements::Check,
    },
    physical::{
        barriers::{Barrier, BarrierClearances, Nearest, nearest_hand, nearest_obstacle, skin_toward_solid},
        grip::{FEWEST_CONTACTS, FORBIDDEN_CLEARANCE, Gripper, PosedHold},
        presented::Presented,
        solids::{HandSolids, NearestParts, SOFT_CONTACT, SolidPart},
    },
};

/// The counterpart of a measured part of the hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Against {
    /// Another hand or an obstacle.
    Barrier(Barrier),
    /// Another part of the same hand.
    Part(SolidPart),
}

impl fmt::Display for Against {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Barrier(barrier) => barrier.fmt(f),
            Self::Part(part) => part.fmt(f),
        }
    }
}

/// The result of a check.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The check.
    pub check: Check,
    /// True if the hand passes it.
    pub passed: bool,
    /// The figure, in the unit of the check; `None` if there is nothing to measure.
    pub figure: Option<f32>,
    /// The least or the largest figure that passes.
    pub bound: Option<f32>,
    /// Place of the measurement, in the object's frame.
    pub at: Option<Vec3>,
    /// The part of the hand that is measured.
    pub part: Option<SolidPart>,
    /// The counterpart of that part, unless it is the object.
    pub against: Option<Against>,
    /// The verdict in words, in SI units.
    pub description: String,
}

/// The verdicts on a hand.
#[derive(Clone, Debug)]
pub struct Judgement {
    /// One verdict per check, in the order of [`Check::OF_HAND`].
    pub verdicts: Vec<Verdict>,
    /// The hand as a grasp, with contacts, forces as far as they balance, and margins. Its score is empty unless it is valid.
    pub grasp: Grasp,
}

impl Judgement {
    /// True if the hand passes every check.
    pub fn is_valid(&self) -> bool {
        self.verdicts.iter().all(|verdict| verdict.passed)
    }
}

/// Judges a hand in the object's frame; every number of its pose must be finite. Takes some tenths of a millisecond.
///
/// # Errors
/// [`Stopped`].
pub fn judge(task: Task<'_>, query: &Query, pose: &HandPose, stop: Stop<'_>) -> Result<Judgement, Stopped> {
    let Task { holdout, rig, .. } = task;
    let presented = Presented::of(holdout);
    let reading = Reading::new(query.around(holdout, &presented, rig), holdout, pose);
    let mut gripper = Gripper::default();
    let held = reading.held(&mut gripper);
    stop.check()?;
    let deepest = reading.deepest(stop)?;
    let hand = nearest_hand(&reading.tracked, holdout, &presented);
    stop.check()?;
    let obstacle = nearest_obstacle(&reading.tracked, &presented);
    let arm = reading.arm();
    let grasp = held.grasp(
        held.classification(),
        depth(deepest.as_ref()).figure,
        BarrierClearances {
            hands: hand.map(|nearest| nearest.distance),
            obstacles: obstacle.map(|nearest| nearest.distance),
        },
        arm,
    );
    let is_not_banned = reading.around.is_not_banned(pose.frame_from_wrist);
    let of_banned = if is_not_banned {
        "it is not near a forbidden grip"
    } else {
        "it is near a forbidden grip of the object"
    };
    let verdicts = vec![
        joint_limits(rig, pose, &reading.solids),
        penetration(deepest),
        clearance(Check::GiverClearance, hand),
        clearance(Check::ObstacleClearance, obstacle),
        self_collision(NearestParts::of(rig, &reading.solids)),
        contacts(&held),
        forbidden(reading.nearest_forbidden()),
        closure(&held.hold),
        balance(&held),
        reach(&reading, reading.reach(arm.as_ref())),
        requirements(&reading, &held),
        Verdict::new(Check::Banned, is_not_banned, of_banned),
    ];
    let mut judgement = Judgement { verdicts, grasp };
    if judgement.is_valid() {
        judgement.grasp = held.scored(judgement.grasp);
    }
    Ok(judgement)
}

/// Tolerance of angles in radians, for the rounding of clients that count in degrees.
const ANGLE_SLACK: f32 = 1e-3;

impl Verdict {
    fn new(check: Check, passed: bool, description: impl Into<String>) -> Self {
        Self {
            check,
            passed,
            figure: None,
            bound: None,
            at: None,
            part: None,
            against: None,
            description: description.into(),
        }
    }

    fn measured(check: Check, measure: Measure, description: String) -> Self {
        Self {
            figure: Some(measure.figure),
            bound: Some(measure.bound),
            ..Self::new(check, measure.passed, description)
        }
    }

    fn of(self, part: SolidPart, at: Vec3, against: Option<Against>) -> Self {
        Self {
            at: Some(at),
            part: Some(part),
            against,
            ..self
        }
    }
}

fn self_collision(parts: Option<NearestParts>) -> Verdict {
    let check = Check::SelfCollision;
    let Some(parts) = parts else {
        return Verdict::new(check, true, "no parts of the hand can meet");
    };
    let [(part, ours), (other, theirs)] = parts.parts;
    let (distance, rest_overlap) = (parts.clearance - SOFT_CONTACT, parts.rest_overlap);
    let depth = millimetres(-distance);
    let place = if distance < 0.0 && rest_overlap > 0.0 {
        format!("presses {depth} deeper than at rest into")
    } else if distance < 0.0 {
        format!("presses {depth} into")
    } else {
        format!("is {} from", millimetres(distance))
    };
    let yields = millimetres(SOFT_CONTACT);
    let description = format!("the {part} {place} the {other}; both yield by {yields}");
    let measure = Measure::at_least(distance, -SOFT_CONTACT);
    Verdict::measured(check, measure, description).of(
        part,
        skin_toward_solid(&ours, &theirs),
        Some(Against::Part(other)),
    )
}

fn forbidden(nearest: Option<NearestPart>) -> Verdict {
    let Some(NearestPart { distance, part, at }) = nearest else {
        return Verdict::new(Check::Forbidden, true, "no surface is forbidden");
    };
    let place = place(distance, "deep in");
    let least = millimetres(FORBIDDEN_CLEARANCE);
    let description = format!("the {part} is {place} a forbidden surface; it must keep {least}");
    let measure = Measure::at_least(distance, FORBIDDEN_CLEARANCE);
    Verdict::measured(Check::Forbidden, measure, description).of(part, at, None)
}

/// Whether the arm reaches the wrist and the requirements admit it. The figure is the excess of the distance from the shoulder.
fn reach(reading: &Reading<'_>, arm: Option<Measure>) -> Verdict {
    let constrained = reading.constrained_reach();
    let is_failed = |reach: &Measure| !reach.passed;
    let decisive = arm.filter(is_failed).or(constrained.filter(is_failed));
    let Some(reach) = decisive.or(arm).or(constrained) else {
        return Verdict::new(Check::Reach, true, "where the receiver stands is not given");
    };
    let distance = reach.figure;
    let missing = (distance - reach.bound).max(0.0);
    let description = if reach.passed {
        format!("the arm reaches the wrist, {distance:.3} m from the shoulder")
    } else if missing > 0.0 {
        let beyond = millimetres(missing);
        format!("the wrist is {distance:.3} m from the shoulder, {beyond} beyond the arm's reach")
    } else {
        "the arm is long enough, but wrist or elbow would bend too far, or the arm would go through something"
            .to_owned()
    };
    Verdict {
        figure: Some(missing),
        bound: Some(0.0),
        at: Some(reading.pose.frame_from_wrist.position),
        ..Verdict::new(Check::Reach, reach.passed, description)
    }
}

fn penetration(deepest: Option<NearestPart>) -> Verdict {
    let measure = depth(deepest.as_ref());
    let verdict = |description| Verdict::measured(Check::Penetration, measure, description);
    let Some(NearestPart { part, at, .. }) = deepest else {
        return verdict("no part of the hand is in the object".to_owned());
    };
    let [depth, yields] = [measure.figure, measure.bound].map(millimetres);
    verdict(format!(
        "the {part} is {depth} deep in the object; flesh yields by {yields}"
    ))
    .of(part, at, None)
}

fn clearance(check: Check, nearest: Option<Nearest>) -> Verdict {
    let Some(nearest) = nearest else {
        return Verdict::new(check, true, "there is nothing to keep clear of");
    };
    let (part, barrier) = (nearest.part, nearest.barrier);
    let measure = reading::clearance(&nearest);
    let place = place(nearest.distance, "inside");
    let least = millimetres(measure.bound);
    let description = format!("the {part} is {place} {barrier}; it must keep {least}");
    Verdict::measured(check, measure, description).of(part, nearest.at, Some(Against::Barrier(barrier)))
}

fn contacts(held: &Held<'_>) -> Verdict {
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

fn closure(hold: &PosedHold) -> Verdict {
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

fn balance(held: &Held<'_>) -> Verdict {
    let measure = held.balance();
    let [share, most] = [measure.figure, measure.bound].map(|share| 100.0 * share);
    Verdict::measured(
        Check::Balance,
        measure,
        format!("{share:.1} % of the weight are left unbalanced; up to {most:.1} % may be"),
    )
}

fn requirements(reading: &Reading<'_>, held: &Held<'_>) -> Verdict {
    let requirements = reading.around.requirements;
    let unmet: Vec<&str> = [
        (
            requirements.admits_approach(reading.pose.frame_from_wrist),
            "approach",
        ),
        (requirements.admits_contacts(held.contacts), "digits"),
        (
            requirements.admits_type(held.classification().grasp_type),
            "grasp types",
        ),
        (held.is_comfort_admitted(), "comfort"),
    ]
    .into_iter()
    .filter_map(|(is_met, what)| (!is_met).then_some(what))
    .collect();
    let description = if requirements.is_empty() {
        "nothing more is required".to_owned()
    } else if unmet.is_empty() {
        "all requirements are met".to_owned()
    } else {
        format!("the requirements on {} are not met", unmet.join(", "))
    };
    Verdict::new(Check::Requirements, unmet.is_empty(), description)
}

/// The largest excess of the hand's angles; searches keep the limits, and requests with such current grasps are refused.
fn joint_limits(rig: &Rig, pose: &HandPose, solids: &HandSolids) -> Verdict {
    let digits = Digit::ALL.into_iter().filter(|&digit| rig.has(digit));
    let angles = digits.flat_map(|digit| {
        let (limits, angles) = (&rig.digit(digit).limits, pose.digits[digit.index()]);
        let [first, second, third] = Phalanx::ALL;
        [
            (first, "base_yaw", angles.base_yaw, limits.base_yaw),
            (first, "base_pitch", angles.base_pitch, limits.base_pitch),
            (second, "second_pitch", angles.second_pitch, limits.second_pitch),
            (third, "third_pitch", angles.third_pitch, limits.third_pitch),
        ]
        .map(|(phalanx, name, angle, AngleRange { min, max })| {
            let excess = (min - angle).max(angle - max).max(0.0);
            (excess, digit, phalanx, move |part: SolidPart| {
                format!("{name} of the {part} is {angle:.3} rad; its limits are {min:.3} and {max:.3} rad")
            })
        })
    });
    let Some((excess, digit, phalanx, describe)) = angles.max_by(|a, b| a.0.total_cmp(&b.0)) else {
        return Verdict::new(Check::JointLimits, true, "the hand has no digits");
    };
    let part = SolidPart::Phalanx(digit, phalanx);
    let measure = Measure::new(excess, ANGLE_SLACK, excess <= ANGLE_SLACK);
    let description = if measure.passed {
        "every angle is within its limits".to_owned()
    } else {
        describe(part)
    };
    let at = solids.phalanges[digit.index()][phalanx.index()].start;
    Verdict::measured(Check::JointLimits, measure, description).of(part, at, None)
}

/// Describes a part's distance from something, in metres.
fn place(distance: f32, inside: &str) -> String {
    if distance < 0.0 {
        format!("{} {inside}", millimetres(-distance))
    } else {
        format!("{} from", millimetres(distance))
    }
}

fn millimetres(metres: f32) -> String {
    format!("{:.1} mm", 1000.0 * metres)
}
