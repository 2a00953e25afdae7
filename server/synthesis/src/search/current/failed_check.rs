//! Reasons, with the deciding figure: why a current grasp is not kept, why a preferred hand is passed over, and why no grasp was
//! found.

use std::fmt;

use crate::{
    base::stop::unstopped,
    model::{
        grasp::Grasp,
        grasp_type::Classification,
        hand::HandPose,
        holdout::ArmPose,
        requirements::{Check, Requirements},
    },
    physical::{
        barriers::{BarrierClearances, Nearest, nearest_hand, nearest_obstacle},
        grip::{self, FORBIDDEN_CLEARANCE, Gripper, PosedDigits},
        presented::Presented,
        solids::{NearestParts, SOFT_CONTACT, self_clearance},
    },
    search::{
        limits::Limit,
        reading::{Held, Measure, Reading, clearance, depth},
        scene::{Scene, Task},
        settings::SearchSettings,
    },
};

/// How much closer than measured a forbidden surface may be, in metres; see
/// [`crate::geometry::mesh_bvh::MeshBvh::closest_to_capsule`].
const GAP_SLACK: f32 = 2e-5;

/// The check that a current grasp failed, and by how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FailedCheck {
    /// The check.
    pub check: Check,
    /// The deciding figure, in the unit of the check.
    pub figure: Option<f32>,
    /// The bound that it violates, in the same unit.
    pub bound: Option<f32>,
}

impl FailedCheck {
    fn new(check: Check) -> Self {
        Self {
            check,
            figure: None,
            bound: None,
        }
    }

    fn by(check: Check, measure: Measure) -> Self {
        Self {
            check,
            figure: Some(measure.figure),
            bound: Some(measure.bound),
        }
    }
}

/// The grasp of an unchanged hand, which may be closer to other people's hands by `grace` metres.
pub(in crate::search) fn held(
    reading: &Reading<'_>,
    grace: f32,
    gripper: &mut Gripper,
) -> Result<Box<Grasp>, FailedCheck> {
    let clearances = clear_of_barriers(reading, grace)?;
    let penetration = clear_of_solids(reading)?;
    let arm = wrist_admitted(reading)?;
    let held = reading.held(gripper);
    let classification = holding(&held, reading.around.requirements)?;
    let grasp = held.grasp(classification, penetration, clearances, arm);
    Ok(Box::new(held.scored(grasp)))
}

fn clear_of_barriers(reading: &Reading<'_>, grace: f32) -> Result<BarrierClearances, FailedCheck> {
    let (tracked, presented) = (&reading.tracked, reading.around.presented);
    if let Some(clearances) = grip::clear_of_barriers(tracked, presented.barriers()) {
        return Ok(clearances);
    }
    let clear_of = |nearest: Option<Nearest>, check, grace: f32| {
        let Some(nearest) = nearest else { return Ok(None) };
        let measure = clearance(&nearest);
        if measure.figure < measure.bound - grace {
            kept(check, measure)?;
        }
        Ok(Some(nearest.distance))
    };
    let hand = nearest_hand(tracked, reading.holdout, presented);
    let obstacle = || nearest_obstacle(tracked, presented);
    Ok(BarrierClearances {
        hands: clear_of(hand, Check::GiverClearance, grace)?,
        obstacles: clear_of(obstacle(), Check::ObstacleClearance, 0.0)?,
    })
}

/// The depth of the hand in the object, in metres.
fn clear_of_solids(reading: &Reading<'_>) -> Result<f32, FailedCheck> {
    let deepest = unstopped(|stop| reading.deepest(stop));
    let penetration = depth(deepest.as_ref());
    kept(Check::Penetration, penetration)?;
    let (rig, object) = (reading.around.rig, reading.around.object.object);
    if self_clearance(rig, &reading.solids) < 0.0
        && let Some(parts) = NearestParts::of(rig, &reading.solids)
    {
        let measure = Measure::at_least(parts.clearance - SOFT_CONTACT, -SOFT_CONTACT);
        kept(Check::SelfCollision, measure)?;
    }
    let is_near = |part| object.is_forbidden_within(part, FORBIDDEN_CLEARANCE + GAP_SLACK);
    if reading.solids.iter().any(is_near)
        && let Some(nearest) = reading.nearest_forbidden()
    {
        let measure = Measure::at_least(nearest.distance, FORBIDDEN_CLEARANCE);
        kept(Check::Forbidden, measure)?;
    }
    Ok(penetration.figure)
}

fn wrist_admitted(reading: &Reading<'_>) -> Result<Option<ArmPose>, FailedCheck> {
    let (around, wrist) = (&reading.around, reading.pose.frame_from_wrist);
    let arm = around.required_arm(wrist);
    if let Some(reach) = reading.reach(arm.as_ref())
        && !reach.passed
    {
        return Err(if reach.figure > reach.bound {
            FailedCheck::by(Check::Reach, reach)
        } else {
            FailedCheck::new(Check::Reach)
        });
    }
    if let Some(reach) = reading.constrained_reach() {
        kept(Check::Reach, reach)?;
    }
    holds(Check::Approach, around.requirements.admits_approach(wrist))?;
    holds(Check::Banned, around.is_not_banned(wrist))?;
    Ok(arm)
}

fn holding(held: &Held<'_>, requirements: &Requirements) -> Result<Classification, FailedCheck> {
    holds(Check::Digits, requirements.admits_contacts(held.contacts))?;
    if !held.hold.is_enclosed {
        return Err(FailedCheck {
            check: Check::Closure,
            figure: Some(held.hold.epsilon),
            bound: held.hold.required,
        });
    }
    let classification = held.classification();
    let is_admitted = requirements.admits_type(classification.grasp_type);
    holds(Check::GraspType, is_admitted)?;
    kept(Check::Balance, held.balance())?;
    holds(Check::Comfort, held.is_comfort_admitted())?;
    Ok(classification)
}

fn kept(check: Check, measure: Measure) -> Result<(), FailedCheck> {
    let passed = measure.passed.then_some(());
    passed.ok_or_else(|| FailedCheck::by(check, measure))
}

fn holds(check: Check, passed: bool) -> Result<(), FailedCheck> {
    passed.then_some(()).ok_or_else(|| FailedCheck::new(check))
}

/// The places of the invalid hands among the first `count` preferred ones, each with the first check that it fails once its digits
/// just touch. Takes some tens of microseconds per hand.
pub fn passed_over(task: Task<'_>, settings: &SearchSettings, count: usize) -> Vec<(usize, FailedCheck)> {
    let Task { holdout, rig, .. } = task;
    let query = &settings.query;
    let hands = settings.known.preferred.iter().take(count);
    if hands.len() == 0 || !query.uses_known_grips() {
        return Vec::new();
    }
    let presented = Presented::of(holdout);
    let alone = presented.without_barriers();
    let around = query.around(holdout, &presented, rig);
    let mut gripper = Gripper::default();
    let failed = |hand: &HandPose, gripper: &mut Gripper| {
        let closed = gripper.hold_posed(&around.object, rig, hand, &alone, PosedDigits::Settled);
        let pose = closed.map_or(*hand, |(grip, _)| grip.pose);
        held(&Reading::new(around, holdout, &pose), 0.0, gripper).err()
    };
    let failures = hands.enumerate();
    failures
        .filter_map(|(place, hand)| Some((place, failed(hand, &mut gripper)?)))
        .collect()
}

/// Why no grasp was found: [`Check::GiverClearance`], [`Check::Holdable`], [`Check::Reach`] or [`Check::Time`], by the limits of
/// the holdout or, without a limit, by the check that most grips fail of those that would hold.
pub fn no_grasp_reason(scene: &Scene<'_>, settings: &SearchSettings, limits: &[Limit]) -> Check {
    let is_limited_by = |check: Check| limits.iter().any(|limit| limit.check == check);
    let unholdable = [Check::Mass, Check::Torque, Check::Width, Check::Forbidden];
    if unholdable.into_iter().any(is_limited_by) {
        Check::Holdable
    } else if is_limited_by(Check::GiverClearance) {
        Check::GiverClearance
    } else if is_limited_by(Check::Reach) {
        Check::Reach
    } else {
        of_known_grips(scene, settings)
    }
}

fn of_known_grips(scene: &Scene<'_>, settings: &SearchSettings) -> Check {
    let (Some(around), Some(atlas)) = (scene.surroundings(), settings.known.atlas.as_deref()) else {
        return Check::Time;
    };
    let presented = around.presented;
    let (mut blocked, mut unreached, mut others) = (0_usize, 0_usize, 0_usize);
    for index in atlas.holding_under(presented.up) {
        let entry = &atlas.entries()[usize::from(index)];
        let wrist = entry.grip.pose.frame_from_wrist;
        let is_within = scene.query.requirements.reaches(wrist);
        let is_clear =
            || grip::clear_of_barriers(&entry.tracked_solids(scene.task.rig), presented.barriers()).is_some();
        if !is_within || !presented.receiver.reaches(scene.task.rig, wrist) {
            unreached += 1;
        } else if !is_clear() {
            blocked += 1;
        } else {
            others += 1;
        }
    }
    if blocked > unreached.max(others) {
        Check::GiverClearance
    } else if unreached > blocked.max(others) {
        Check::Reach
    } else {
        Check::Time
    }
}

impl fmt::Display for FailedCheck {
    /// A phrase that completes "the grasp failed:".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [figure, bound] = [self.figure, self.bound].map(Option::unwrap_or_default);
        let [mm, bound_mm] = [figure, bound].map(|metres| 1e3 * metres);
        let nears = |what: &str| {
            if figure < 0.0 {
                format!("the hand is {:.1} mm inside {what}", -mm)
            } else {
                format!("the hand is {mm:.1} mm from {what}, less than {bound_mm:.1} mm")
            }
        };
        f.write_str(&match self.check {
            Check::GiverClearance => nears("another person's hand"),
            Check::ObstacleClearance => nears("an obstacle"),
            Check::Forbidden => nears("a forbidden surface"),
            Check::Penetration => {
                format!("the hand sinks {mm:.1} mm into the object, more than {bound_mm:.1} mm")
            }
            Check::SelfCollision => {
                let [mm, most] = [-mm, -bound_mm];
                format!("parts of the hand go {mm:.1} mm through each other, more than {most:.1} mm")
            }
            Check::Reach if self.figure.is_none() => {
                "the receiver's arm does not reach the wrist clear of object and others".to_owned()
            }
            Check::Reach => {
                format!("the wrist is {figure:.2} m from the shoulder, beyond the reach of {bound:.2} m")
            }
            Check::Approach => "the hand does not come from within the required approach".to_owned(),
            Check::Banned => "the hand is near a forbidden grip".to_owned(),
            Check::Digits => "the requirements do not admit the digits that touch".to_owned(),
            Check::Closure => {
                // A share of no closure is 0.
                let share = if figure > 0.0 {
                    (figure / bound).min(1.0)
                } else {
                    0.0
                };
                let percent = 100.0 * share;
                format!("the contacts have {percent:.0} % of the closure that holds the object")
            }
            Check::GraspType => "the requirements do not admit the grasp's type".to_owned(),
            Check::Balance => {
                let [percent, most] = [figure, bound].map(|share| 100.0 * share);
                format!("the contacts leave {percent:.0} % of the weight unbalanced, more than {most:.0} %")
            }
            Check::Comfort => "the forces are less comfortable than the requirements admit".to_owned(),
            Check::Score => {
                format!("the score of another grasp is higher by {figure:.3}, at least {bound:.3}")
            }
            other => format!("the hand fails the check {other:?}"),
        })
    }
}
