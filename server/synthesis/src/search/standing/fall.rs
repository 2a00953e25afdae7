//! Why a standing grasp is not kept, with the figure that decides.

use std::fmt;

use crate::{
    model::hand::HandPose,
    physical::{
        barriers::{Barriers, OBSTACLE_CLEARANCE},
        grip::{FORBIDDEN_CLEARANCE, GIVER_CLEARANCE, Gripper, HoldsBy, MAX_PENETRATION},
        immobility::BALANCE_TOLERANCE,
        scene::ObjectScene,
        solids::{HandSolids, SOFT_CONTACT, TrackedSolids, clearance, self_clearance},
    },
    rating::assessment::GraspContext,
};

/// Halvings of the interval in which a distance from a forbidden surface is sought: to a micrometre.
const HALVINGS: usize = 13;

/// Depth of a hand below a forbidden surface, in metres, beyond which it is not measured.
const DEEPEST: f32 = 0.005;

/// Why a standing grasp is not kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FallReason {
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
    /// The wrist is outside the constraints' reach; the distance from their shoulder in metres.
    OutOfConstrainedReach,
    /// The hand approaches from outside the constraints' cone.
    Approach,
    /// It is near a banned grip.
    BannedGrip,
    /// The constraints do not admit the digits that touch.
    Digits,
    /// The contacts lack closure; their share of the required one.
    NotClosed,
    /// The constraints do not admit the grasp's type.
    GraspType,
    /// The contacts do not balance the weight; the share of it that they leave unbalanced.
    Unbalanced,
    /// The forces are less comfortable than the constraints admit.
    Comfort,
    /// A known grip is better; the difference of the scores.
    BetterGrasp,
}

/// Why a standing grasp is not kept, and by how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fall {
    /// Why.
    pub reason: FallReason,
    /// The figure that decided, in the unit of its reason.
    pub figure: Option<f32>,
    /// The bound that it violates, in the same unit.
    pub bound: Option<f32>,
}

impl Fall {
    fn new(reason: FallReason) -> Self {
        Self {
            reason,
            figure: None,
            bound: None,
        }
    }

    fn with(reason: FallReason, figure: f32, bound: f32) -> Self {
        Self {
            reason,
            figure: Some(figure),
            bound: Some(bound),
        }
    }

    /// The first check that a hand fails which does not hold. Checks come in the order of [`FallReason`].
    pub(super) fn of(around: &GraspContext<'_>, pose: &HandPose, gripper: &mut Gripper) -> Self {
        let GraspContext {
            object,
            presented,
            rig,
            ..
        } = around;
        let solids = HandSolids::of_pose(rig, pose);
        let tracked = TrackedSolids::of_rig(rig, pose.frame_from_wrist, &solids);
        by_barriers(&tracked, presented.barriers())
            .or_else(|| by_solids(object, &solids))
            .or_else(|| by_wrist(around, pose))
            .unwrap_or_else(|| by_contacts(around, pose, gripper))
    }
}

fn by_barriers(hand: &TrackedSolids, barriers: Barriers<'_>) -> Option<Fall> {
    let clearances = barriers.clearances(hand, f32::NEG_INFINITY)?;
    if let Some(distance) = clearances.hands.filter(|&distance| distance < GIVER_CLEARANCE) {
        return Some(Fall::with(FallReason::Giver, distance, GIVER_CLEARANCE));
    }
    let distance = clearances
        .obstacles
        .filter(|&distance| distance < OBSTACLE_CLEARANCE)?;
    Some(Fall::with(FallReason::Obstacle, distance, OBSTACLE_CLEARANCE))
}

fn by_solids(object: &ObjectScene<'_>, solids: &HandSolids) -> Option<Fall> {
    let surface = &object.object.surface;
    let deepest = solids
        .iter()
        .fold(0.0, |least: f32, part| clearance(part, surface, least).min(least));
    if deepest < -MAX_PENETRATION {
        return Some(Fall::with(FallReason::Penetration, -deepest, MAX_PENETRATION));
    }
    let through = self_clearance(solids);
    if through < 0.0 {
        return Some(Fall::with(
            FallReason::SelfCollision,
            through - SOFT_CONTACT,
            -SOFT_CONTACT,
        ));
    }
    let distance = forbidden_distance(object, solids)?;
    Some(Fall::with(FallReason::Forbidden, distance, FORBIDDEN_CLEARANCE))
}

/// The distance from a forbidden surface in metres, if it is less than [`FORBIDDEN_CLEARANCE`]; at least -[`DEEPEST`].
fn forbidden_distance(object: &ObjectScene<'_>, solids: &HandSolids) -> Option<f32> {
    let nears = |distance: f32| {
        let mut parts = solids.iter();
        parts.any(|part| object.object.is_forbidden_within(part, distance))
    };
    if !nears(FORBIDDEN_CLEARANCE) {
        return None;
    }
    let (mut beyond, mut within) = (-DEEPEST, FORBIDDEN_CLEARANCE);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (beyond + within);
        if nears(middle) {
            within = middle;
        } else {
            beyond = middle;
        }
    }
    Some(within)
}

fn by_wrist(around: &GraspContext<'_>, pose: &HandPose) -> Option<Fall> {
    let GraspContext {
        object,
        presented,
        rig,
        constraints,
    } = around;
    let wrist = pose.frame_from_wrist;
    let receiver = &presented.receiver;
    if receiver.must_reach() && presented.arm_of(object.object, rig, wrist).is_none() {
        let [distance, longest] = receiver.shoulder_distance(wrist)?;
        return Some(if distance > longest {
            Fall::with(FallReason::OutOfReach, distance, longest)
        } else {
            Fall::new(FallReason::OutOfReach)
        });
    }
    if let Some(reach) = constraints.reach
        && !reach.admits(wrist)
    {
        let distance = reach.shoulder.distance(wrist.position);
        return Some(Fall::with(
            FallReason::OutOfConstrainedReach,
            distance,
            reach.distance,
        ));
    }
    if !constraints.admits_wrist(wrist) {
        return Some(Fall::new(FallReason::Approach));
    }
    let is_banned = !object.object.admits_wrist(rig.handedness, wrist);
    is_banned.then(|| Fall::new(FallReason::BannedGrip))
}

fn by_contacts(around: &GraspContext<'_>, pose: &HandPose, gripper: &mut Gripper) -> Fall {
    let GraspContext {
        object,
        presented,
        rig,
        constraints,
    } = around;
    let held = gripper.hold_given(object, rig, pose, presented, HoldsBy::Closure);
    if !constraints.admits_contacts(&gripper.contacts) {
        return Fall::new(FallReason::Digits);
    }
    if held.is_err() {
        return Fall::with(FallReason::NotClosed, gripper.closure_share().min(1.0), 1.0);
    }
    if !constraints.admits_type(around.grasp_type(pose, &gripper.contacts)) {
        return Fall::new(FallReason::GraspType);
    }
    let unbalanced = gripper.unbalanced_share(object, presented.up);
    if unbalanced > BALANCE_TOLERANCE {
        return Fall::with(FallReason::Unbalanced, unbalanced, BALANCE_TOLERANCE);
    }
    Fall::new(FallReason::Comfort)
}

impl fmt::Display for Fall {
    /// A phrase that completes "the grasp fell:".
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
            FallReason::Giver => nears(f, "another person's hand"),
            FallReason::Obstacle => nears(f, "an obstacle"),
            FallReason::Forbidden => nears(f, "a forbidden surface"),
            FallReason::Penetration => write!(
                f,
                "the hand sinks {:.1} mm into the object, more than {:.1} mm",
                mm(figure),
                mm(bound)
            ),
            FallReason::SelfCollision => write!(
                f,
                "parts of the hand go {:.1} mm through each other, more than {:.1} mm",
                -mm(figure),
                -mm(bound)
            ),
            FallReason::OutOfReach if self.figure.is_none() => {
                f.write_str("the receiver's arm does not reach the wrist clear of object and others")
            }
            FallReason::OutOfReach | FallReason::OutOfConstrainedReach => write!(
                f,
                "the wrist is {figure:.2} m from the shoulder, beyond the reach of {bound:.2} m"
            ),
            FallReason::Approach => f.write_str("the hand does not come from within constraints.approach"),
            FallReason::BannedGrip => f.write_str("the hand is near a banned grip"),
            FallReason::Digits => f.write_str("the constraints do not admit the digits that touch"),
            FallReason::NotClosed => write!(
                f,
                "the contacts have {:.0} % of the closure that holds the object",
                100.0 * figure
            ),
            FallReason::GraspType => f.write_str("the constraints do not admit the grasp's type"),
            FallReason::Unbalanced => write!(
                f,
                "the contacts leave {:.0} % of the weight unbalanced, more than {:.0} %",
                100.0 * figure,
                100.0 * bound
            ),
            FallReason::Comfort => f.write_str("the forces are less comfortable than the constraints admit"),
            FallReason::BetterGrasp => write!(
                f,
                "the score of another grasp is higher by {figure:.3}, at least {bound:.3}"
            ),
        }
    }
}
