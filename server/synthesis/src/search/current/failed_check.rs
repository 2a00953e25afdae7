//! Why a current grasp is not kept, with the figure that decides.

use std::fmt;

use crate::{
    base::stop::unstopped,
    model::{grasp::Grasp, grasp_type::Classification, receiver::ArmPose},
    physical::{barriers::BarrierClearances, grip::Gripper, nearest::Nearest},
    search::reading::{Deepest, Held, Measure, Reading, clearance},
};

/// Why a current grasp is not kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailedCheckReason {
    /// Hand or forearm are too close to another person's hand; the distance in metres, negative inside.
    Giver,
    /// They are too close to an obstacle; likewise.
    Obstacle,
    /// The hand sinks into the object; the depth in metres.
    Penetration,
    /// Parts of the hand go through each other; the distance in metres, negative.
    SelfCollision,
    /// A forbidden surface is too close; the distance in metres.
    Forbidden,
    /// The receiver's arm does not reach the wrist; the distance from the shoulder in metres, if that decides.
    OutOfReach,
    /// The wrist is outside the requirements' reach; the distance from their shoulder in metres.
    OutOfConstrainedReach,
    /// The hand approaches from outside the requirements' cone.
    Approach,
    /// It is near a banned grip.
    BannedGrip,
    /// The requirements do not admit the digits that touch.
    Digits,
    /// The contacts lack closure; their epsilon, and the required one unless the object could only hang in the fingers.
    NotClosed,
    /// The requirements do not admit the grasp's type.
    GraspType,
    /// The contacts do not balance the weight; the share of it that they leave unbalanced.
    Unbalanced,
    /// The forces are less comfortable than the requirements admit.
    Comfort,
    /// A known grip is better; the difference of the scores.
    BetterGrasp,
}

/// Why a current grasp is not kept, and by how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FailedCheck {
    /// Why.
    pub reason: FailedCheckReason,
    /// The figure that decided, in the unit of its reason.
    pub figure: Option<f32>,
    /// The bound that it violates, in the same unit.
    pub bound: Option<f32>,
}

impl FailedCheck {
    fn new(reason: FailedCheckReason) -> Self {
        Self {
            reason,
            figure: None,
            bound: None,
        }
    }

    fn by(reason: FailedCheckReason, measure: Measure) -> Self {
        Self {
            reason,
            figure: Some(measure.figure),
            bound: Some(measure.bound),
        }
    }
}

/// The grasp of a hand as it is, which may be closer to other people's hands by `grace` metres.
///
/// # Errors
/// The first check that it fails, in the order of [`FailedCheckReason`].
pub(in crate::search) fn held(
    reading: &Reading<'_>,
    grace: f32,
    gripper: &mut Gripper,
) -> Result<Box<Grasp>, FailedCheck> {
    let clearances = clear_of_barriers(reading, grace)?;
    let penetration = clear_of_solids(reading)?;
    let arm = wrist_admitted(reading)?;
    let held = reading.held(gripper);
    let classification = holding(&held)?;
    let grasp = held.grasp(classification, penetration, clearances, arm);
    Ok(Box::new(held.scored(grasp)))
}

fn clear_of_barriers(reading: &Reading<'_>, grace: f32) -> Result<BarrierClearances, FailedCheck> {
    if let Some(clearances) = reading.if_clear_of_barriers() {
        return Ok(clearances);
    }
    let clear_of = |nearest: Option<Nearest>, reason, grace: f32| {
        let Some(nearest) = nearest else { return Ok(None) };
        let measure = clearance(&nearest);
        if measure.figure < measure.bound - grace {
            kept(reason, measure)?;
        }
        Ok(Some(nearest.distance))
    };
    Ok(BarrierClearances {
        hands: clear_of(reading.nearest_hand(), FailedCheckReason::Giver, grace)?,
        obstacles: clear_of(reading.nearest_obstacle(), FailedCheckReason::Obstacle, 0.0)?,
    })
}

/// The depth of the hand in the object, in metres.
fn clear_of_solids(reading: &Reading<'_>) -> Result<f32, FailedCheck> {
    let deepest = unstopped(|stop| reading.deepest(stop));
    let penetration = Deepest::measure(deepest.as_ref());
    kept(FailedCheckReason::Penetration, penetration)?;
    if !reading.is_clear_of_itself()
        && let Some(parts) = reading.closest_parts()
    {
        kept(FailedCheckReason::SelfCollision, parts.measure())?;
    }
    if !reading.is_clear_of_forbidden()
        && let Some(nearest) = reading.nearest_forbidden()
    {
        kept(FailedCheckReason::Forbidden, nearest.measure())?;
    }
    Ok(penetration.figure)
}

/// The receiver's arm, if it must reach the wrist.
fn wrist_admitted(reading: &Reading<'_>) -> Result<Option<ArmPose>, FailedCheck> {
    let must_reach = reading.around.presented.receiver.must_reach();
    let arm = must_reach.then(|| reading.arm()).flatten();
    if let Some(reach) = reading.reach(arm.as_ref())
        && !reach.passed
    {
        return Err(if reach.figure > reach.bound {
            FailedCheck::by(FailedCheckReason::OutOfReach, reach)
        } else {
            FailedCheck::new(FailedCheckReason::OutOfReach)
        });
    }
    if let Some(reach) = reading.constrained_reach() {
        kept(FailedCheckReason::OutOfConstrainedReach, reach)?;
    }
    holds(FailedCheckReason::Approach, reading.is_approach_admitted())?;
    holds(FailedCheckReason::BannedGrip, reading.is_not_banned())?;
    Ok(arm)
}

fn holding(held: &Held<'_>) -> Result<Classification, FailedCheck> {
    holds(FailedCheckReason::Digits, held.are_digits_admitted())?;
    if !held.hold.is_enclosed {
        return Err(FailedCheck {
            reason: FailedCheckReason::NotClosed,
            figure: Some(held.hold.epsilon),
            bound: held.hold.required,
        });
    }
    let classification = held.classification();
    holds(
        FailedCheckReason::GraspType,
        held.is_type_admitted(classification),
    )?;
    kept(FailedCheckReason::Unbalanced, held.balance())?;
    holds(FailedCheckReason::Comfort, held.is_comfort_admitted())?;
    Ok(classification)
}

fn kept(reason: FailedCheckReason, measure: Measure) -> Result<(), FailedCheck> {
    if measure.passed {
        Ok(())
    } else {
        Err(FailedCheck::by(reason, measure))
    }
}

fn holds(reason: FailedCheckReason, passed: bool) -> Result<(), FailedCheck> {
    if passed {
        Ok(())
    } else {
        Err(FailedCheck::new(reason))
    }
}

impl fmt::Display for FailedCheck {
    /// A phrase that completes "the grasp failed:".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let figure = self.figure.unwrap_or_default();
        let bound = self.bound.unwrap_or_default();
        let mm = |metres: f32| 1e3 * metres;
        let nears = |f: &mut fmt::Formatter<'_>, what: &str| {
            if figure < 0.0 {
                write!(f, "the hand is {:.1} mm inside {what}", -mm(figure))
            } else {
                write!(
                    f,
                    "the hand is {:.1} mm from {what}, less than {:.1} mm",
                    mm(figure),
                    mm(bound)
                )
            }
        };
        match self.reason {
            FailedCheckReason::Giver => nears(f, "another person's hand"),
            FailedCheckReason::Obstacle => nears(f, "an obstacle"),
            FailedCheckReason::Forbidden => nears(f, "a forbidden surface"),
            FailedCheckReason::Penetration => write!(
                f,
                "the hand sinks {:.1} mm into the object, more than {:.1} mm",
                mm(figure),
                mm(bound)
            ),
            FailedCheckReason::SelfCollision => write!(
                f,
                "parts of the hand go {:.1} mm through each other, more than {:.1} mm",
                -mm(figure),
                -mm(bound)
            ),
            FailedCheckReason::OutOfReach if self.figure.is_none() => {
                f.write_str("the receiver's arm does not reach the wrist clear of object and others")
            }
            FailedCheckReason::OutOfReach | FailedCheckReason::OutOfConstrainedReach => write!(
                f,
                "the wrist is {figure:.2} m from the shoulder, beyond the reach of {bound:.2} m"
            ),
            FailedCheckReason::Approach => {
                f.write_str("the hand does not come from within the required approach")
            }
            FailedCheckReason::BannedGrip => f.write_str("the hand is near a forbidden grip"),
            FailedCheckReason::Digits => f.write_str("the requirements do not admit the digits that touch"),
            FailedCheckReason::NotClosed => {
                // A share of nothing is none.
                let share = if figure > 0.0 {
                    (figure / bound).min(1.0)
                } else {
                    0.0
                };
                write!(
                    f,
                    "the contacts have {:.0} % of the closure that holds the object",
                    100.0 * share
                )
            }
            FailedCheckReason::GraspType => f.write_str("the requirements do not admit the grasp's type"),
            FailedCheckReason::Unbalanced => write!(
                f,
                "the contacts leave {:.0} % of the weight unbalanced, more than {:.0} %",
                100.0 * figure,
                100.0 * bound
            ),
            FailedCheckReason::Comfort => {
                f.write_str("the forces are less comfortable than the requirements admit")
            }
            FailedCheckReason::BetterGrasp => write!(
                f,
                "the score of another grasp is higher by {figure:.3}, at least {bound:.3}"
            ),
        }
    }
}
