//! What is right and wrong with a hand that somebody posed: every check of `PHYSICAL` validity with its figure.
//!
//! Searches stop at the first check that fails, and mostly without knowing by how much. Here every check is made and put into
//! words.

mod checks;

use std::fmt;

use glam::Vec3;

use super::{reading::Reading, scene::Task, settings::Query};
use crate::{
    base::stop::{Stop, Stopped},
    model::{
        grasp::{Grasp, PhysicalMargins},
        hand::HandPose,
        requirements::Check,
    },
    physical::{
        barriers::{Barrier, BarrierClearances},
        grip::Gripper,
        presented::{ObjectScene, Presented},
        solids::SolidPart,
    },
    rating::assessment::GraspContext,
};

/// What a part of the hand is measured against.
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
    /// True if it is passed.
    pub passed: bool,
    /// The figure, in the unit of the check; `None` if there is nothing to measure.
    pub figure: Option<f32>,
    /// The least or the largest figure that passes.
    pub bound: Option<f32>,
    /// Where it is measured, in the object's frame.
    pub at: Option<Vec3>,
    /// The part of the hand that is measured.
    pub part: Option<SolidPart>,
    /// What that part is measured against, unless it is the object.
    pub against: Option<Against>,
    /// All of it in words, in SI units.
    pub description: String,
}

/// What was found about a hand.
#[derive(Clone, Debug)]
pub struct Judgement {
    /// One verdict per check, in the order of [`Check::OF_HAND`].
    pub verdicts: Vec<Verdict>,
    /// The hand as a grasp, with contacts, forces as far as they balance, and margins. Its score is empty unless it is valid.
    pub grasp: Grasp,
}

impl Judgement {
    /// True if every check is passed.
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
    let around = GraspContext {
        object: ObjectScene::new(&holdout.object, query.friction_on(&holdout.object)),
        presented: &presented,
        rig,
        requirements: &query.requirements,
    };
    let reading = Reading::new(around, holdout, pose);
    let mut gripper = Gripper::default();
    let held = reading.held(&mut gripper);
    stop.check()?;
    let deepest = reading.deepest(stop)?;
    let hand = reading.nearest_hand();
    stop.check()?;
    let obstacle = reading.nearest_obstacle();
    let arm = reading.arm();
    let grasp = held.grasp(
        held.classification(),
        deepest.map_or(0.0, |deepest| deepest.depth),
        BarrierClearances {
            hands: hand.map(|nearest| nearest.distance),
            obstacles: obstacle.map(|nearest| nearest.distance),
        },
        arm,
    );
    let verdicts = vec![
        checks::joint_limits(rig, pose, &reading.solids),
        checks::penetration(deepest),
        checks::clearance(Check::GiverClearance, hand),
        checks::clearance(Check::ObstacleClearance, obstacle),
        checks::self_collision(reading.closest_parts()),
        checks::contacts(&held),
        checks::forbidden(reading.nearest_forbidden()),
        checks::closure(&held.hold),
        checks::balance(&held),
        checks::reach(
            [reading.reach(arm.as_ref()), reading.constrained_reach()],
            pose.frame_from_wrist.position,
        ),
        checks::requirements(&reading, &held),
        checks::banned(reading.is_not_banned()),
    ];
    let mut judgement = Judgement { verdicts, grasp };
    if judgement.is_valid() {
        judgement.grasp = held.scored(judgement.grasp);
    }
    Ok(judgement)
}

impl Judgement {
    /// The margins of the hand.
    pub fn margins(&self) -> Option<&PhysicalMargins> {
        self.grasp.margins.as_ref()
    }
}
