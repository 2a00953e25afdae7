//! Checks of a hand that no search closed, with the bounds and functions of the search. A current grasp ([`super::current`]) ends
//! at the first failed check; a client's own hand ([`super::verdicts`]) needs all of them.

use glam::Vec3;

use crate::{
    base::stop::{Stop, Stopped, unstopped},
    model::{
        grasp::{Contact, Grasp},
        grasp_type::{Classification, GraspType},
        hand::HandPose,
        holdout::{ArmPose, Holdout},
    },
    physical::{
        barriers::{Barrier, BarrierClearances, Nearest, OBSTACLE_CLEARANCE},
        grip::{FEWEST_CONTACTS, GIVER_CLEARANCE, Grip, Gripper, MAX_PENETRATION, PosedHold},
        immobility::{BALANCE_TOLERANCE, Balance},
        solids::{HandSolids, SolidPart, TaperedCapsule, TrackedSolids, closest},
    },
    rating::{
        assessment::{GraspContext, unscored_grasp},
        scoring::{comfort, digit_totals},
    },
};

/// Tolerance of distances in metres: a valid grasp loses so much to single precision on its way through a client's frame.
const ROUNDING: f32 = 5e-6;

/// A measured figure, its bound, and whether it keeps that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measure {
    pub(super) figure: f32,
    pub(super) bound: f32,
    pub(super) passed: bool,
}

impl Measure {
    pub(super) fn new(figure: f32, bound: f32, passed: bool) -> Self {
        Self {
            figure,
            bound,
            passed,
        }
    }

    /// A distance in metres and its lower bound.
    pub(super) fn at_least(figure: f32, bound: f32) -> Self {
        Self::new(figure, bound, figure >= bound - ROUNDING)
    }
}

/// The part of a hand nearest to a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct NearestPart {
    /// Distance in metres, negative inside.
    pub(super) distance: f32,
    pub(super) part: SolidPart,
    /// A point of the surface, in the object's frame.
    pub(super) at: Vec3,
}

pub(super) struct Reading<'a> {
    pub(super) around: GraspContext<'a>,
    pub(super) pose: &'a HandPose,
    pub(super) solids: HandSolids,
    pub(super) holdout: &'a Holdout,
    pub(super) tracked: TrackedSolids,
}

impl<'a> Reading<'a> {
    /// Reads a hand in the object's frame; its pose must be finite. `around` must be of the holdout.
    pub(super) fn new(around: GraspContext<'a>, holdout: &'a Holdout, pose: &'a HandPose) -> Self {
        let solids = HandSolids::of_pose(around.rig, pose);
        Self {
            around,
            pose,
            tracked: TrackedSolids::of_rig(around.rig, pose.frame_from_wrist, &solids),
            solids,
            holdout,
        }
    }

    /// The deepest part in the object; `None` if no part is inside.
    pub(super) fn deepest(&self, stop: Stop<'_>) -> Result<Option<NearestPart>, Stopped> {
        let surface = &self.around.object.object.surface;
        self.nearest_part(0.0, stop, |solid, least| {
            closest(solid, surface, least).map(|touch| (touch.gap, touch.position))
        })
    }

    /// The part nearest to a forbidden surface; `None` without forbidden surfaces.
    pub(super) fn nearest_forbidden(&self) -> Option<NearestPart> {
        let surface = self.around.object.object.forbidden_surface()?;
        unstopped(|stop| {
            self.nearest_part(f32::INFINITY, stop, |solid, least| {
                let gap = surface.closest_to_capsule(solid, least)?;
                Some((gap.gap, gap.position))
            })
        })
    }

    /// The part with the least distance below `least`, in metres.
    fn nearest_part(
        &self,
        least: f32,
        stop: Stop<'_>,
        distance: impl Fn(&TaperedCapsule, f32) -> Option<(f32, Vec3)>,
    ) -> Result<Option<NearestPart>, Stopped> {
        let mut nearest: Option<NearestPart> = None;
        for (part, solid) in self.solids.parts() {
            stop.check()?;
            let least = nearest.map_or(least, |nearest| nearest.distance);
            if let Some((distance, at)) = distance(solid, least).filter(|&(distance, _)| distance < least) {
                nearest = Some(NearestPart { distance, part, at });
            }
        }
        Ok(nearest)
    }

    /// The receiver's arm; `None` if the receiver's position is unknown or the arm does not reach the wrist.
    pub(super) fn arm(&self) -> Option<ArmPose> {
        let around = &self.around;
        around
            .presented
            .arm_of(around.object.object, around.rig, self.pose.frame_from_wrist)
    }

    /// The distance from the receiver's shoulder to the wrist and the length of the arm, in metres, and whether [`Self::arm`]
    /// reaches; `None` if no arm has to.
    pub(super) fn reach(&self, arm: Option<&ArmPose>) -> Option<Measure> {
        let receiver = &self.around.presented.receiver;
        let [distance, longest] = receiver.shoulder_distance(self.pose.frame_from_wrist)?;
        Some(Measure::new(distance, longest, self.around.is_reached(arm)))
    }

    /// The distance from the shoulder that the requirements name.
    pub(super) fn constrained_reach(&self) -> Option<Measure> {
        let wrist = self.pose.frame_from_wrist;
        let reach = self.around.requirements.reach?;
        let distance = reach.shoulder.distance(wrist.position);
        Some(Measure::new(distance, reach.distance, reach.admits(wrist)))
    }
}

/// The depth in the object; 0 outside.
pub(super) fn depth(deepest: Option<&NearestPart>) -> Measure {
    let depth = deepest.map_or(0.0, |deepest| -deepest.distance);
    Measure::new(depth, MAX_PENETRATION, depth <= MAX_PENETRATION + ROUNDING)
}

pub(super) fn clearance(nearest: &Nearest) -> Measure {
    let bound = match nearest.barrier {
        Barrier::PresentingHand | Barrier::OtherHand(_) => GIVER_CLEARANCE,
        Barrier::Obstacle(_) => OBSTACLE_CLEARANCE,
    };
    Measure::at_least(nearest.distance, bound)
}

pub(super) struct Held<'a> {
    pub(super) hold: PosedHold,
    pub(super) contacts: &'a [Contact],
    reading: &'a Reading<'a>,
}

impl Reading<'_> {
    /// The grip of the hand, whatever it collides with. The object hangs in it only if the requirements admit hooks.
    pub(super) fn held<'b>(&'b self, gripper: &'b mut Gripper) -> Held<'b> {
        let around = &self.around;
        let requirements = around.requirements;
        let may_hang = |contacts: &[Contact], balance: &Balance| {
            requirements.admits_type(Some(GraspType::FixedHook))
                && requirements.admits_comfort(comfort_of(contacts, balance))
        };
        Held {
            hold: gripper.hold_as_posed(&around.object, around.rig, self.pose, around.presented, may_hang),
            contacts: &gripper.contacts,
            reading: self,
        }
    }
}

impl Held<'_> {
    pub(super) fn contacts(&self) -> Measure {
        let count = self.contacts.len();
        Measure::new(count as f32, FEWEST_CONTACTS as f32, count >= FEWEST_CONTACTS)
    }

    /// The unbalanced share of the weight.
    pub(super) fn balance(&self) -> Measure {
        let residual = self.hold.balance.residual;
        Measure::new(residual, BALANCE_TOLERANCE, residual <= BALANCE_TOLERANCE)
    }

    pub(super) fn classification(&self) -> Classification {
        let Reading { around, pose, .. } = self.reading;
        around.classification(pose, self.contacts, self.hold.hangs())
    }

    pub(super) fn is_comfort_admitted(&self) -> bool {
        let comfort = comfort_of(self.contacts, &self.hold.balance);
        self.reading.around.requirements.admits_comfort(comfort)
    }

    pub(super) fn grasp(
        &self,
        classification: Classification,
        penetration: f32,
        clearances: BarrierClearances,
        arm: Option<ArmPose>,
    ) -> Grasp {
        let hold = &self.hold;
        let grip = Grip {
            pose: *self.reading.pose,
            // A posed hand was not closed by a ratio.
            bend_ratios: hold.touching.map(|touches| touches.then_some(1.0)),
            penetration,
            epsilon: hold.epsilon,
        };
        Grasp {
            hangs: hold.hangs(),
            arm,
            ..unscored_grasp(
                &grip,
                self.contacts,
                classification,
                hold.epsilon,
                hold.balance.clone(),
                self.reading.around.presented,
                clearances,
            )
        }
    }

    pub(super) fn scored(&self, grasp: Grasp) -> Grasp {
        let Reading { around, solids, .. } = self.reading;
        around.scored(grasp, self.hold.relative_closure, solids)
    }
}

fn comfort_of(contacts: &[Contact], balance: &Balance) -> f32 {
    comfort(digit_totals(contacts, &balance.forces))
}
