//! A hand that no search closed, as it is checked: the one place where current grasps and clients' own are measured.
//!
//! A current grasp fails by the first check that fails ([`super::current`]), while verdicts need all of them
//! ([`super::verdicts`]). Both take figures, bounds and decisions from here. The bounds are those of the searches' own checks,
//! and the figures come from the functions that these decide by. Whatever takes long to measure has a test that says sooner that
//! a hand is certainly clear.

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
        barriers::{
            Barrier, BarrierClearances, Nearest, OBSTACLE_CLEARANCE, nearest_hand, nearest_obstacle,
            skin_toward_solid,
        },
        grip::{
            FEWEST_CONTACTS, FORBIDDEN_CLEARANCE, GIVER_CLEARANCE, Grip, Gripper, MAX_PENETRATION, PosedHold,
            clear_of_barriers,
        },
        immobility::{BALANCE_TOLERANCE, Balance},
        solids::{
            HandSolids, NearestParts, SOFT_CONTACT, SolidPart, TaperedCapsule, TrackedSolids, closest,
            self_clearance,
        },
    },
    rating::{
        assessment::{GraspContext, unscored_grasp},
        scoring::{comfort, digit_totals},
    },
};

/// By how much, in metres, distances may fall short of their bounds: a grasp that was valid loses so much to single precision on
/// its way through a client's frame.
const ROUNDING: f32 = 5e-6;

/// How much closer than measured a forbidden surface may be, in metres; see
/// [`crate::geometry::mesh_bvh::MeshBvh::closest_to_capsule`].
const GAP_SLACK: f32 = 2e-5;

/// A figure, its bound, and whether it keeps that.
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

    /// A distance in metres that must not be less than its bound.
    pub(super) fn at_least(figure: f32, bound: f32) -> Self {
        Self::new(figure, bound, figure >= bound - ROUNDING)
    }
}

/// The part of a hand that is nearest to a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct NearestPart {
    /// In metres, negative inside.
    pub(super) distance: f32,
    pub(super) part: SolidPart,
    /// A point of the surface, in the object's frame.
    pub(super) at: Vec3,
}

/// The two parts of a hand that can meet and come closest.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClosestParts {
    /// The one part, and a point of its skin; negative where they overlap more than at rest.
    pub(super) nearest: NearestPart,
    pub(super) other: SolidPart,
    /// How deep they overlap at rest, in metres.
    pub(super) rest_overlap: f32,
}

/// A posed hand and everything that it is checked against.
pub(super) struct Reading<'a> {
    pub(super) around: GraspContext<'a>,
    pub(super) pose: &'a HandPose,
    pub(super) solids: HandSolids,
    holdout: &'a Holdout,
    tracked: TrackedSolids,
}

impl<'a> Reading<'a> {
    /// A hand in the object's frame; every number of its pose must be finite. `around` must be of the holdout.
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

    /// The distances from barriers, if all of them are certainly kept.
    pub(super) fn if_clear_of_barriers(&self) -> Option<BarrierClearances> {
        clear_of_barriers(&self.tracked, self.around.presented.barriers())
    }

    /// The nearest of the other people's hands; `None` without any.
    pub(super) fn nearest_hand(&self) -> Option<Nearest> {
        nearest_hand(&self.tracked, self.holdout, self.around.presented)
    }

    /// The nearest obstacle; `None` without any.
    pub(super) fn nearest_obstacle(&self) -> Option<Nearest> {
        nearest_obstacle(&self.tracked, self.around.presented)
    }

    /// The deepest part in the object; `None` if no part is in it.
    pub(super) fn deepest(&self, stop: Stop<'_>) -> Result<Option<NearestPart>, Stopped> {
        let surface = &self.around.object.object.surface;
        self.nearest_part(0.0, stop, |solid, least| {
            closest(solid, surface, least).map(|touch| (touch.gap, touch.position))
        })
    }

    /// The part nearest to a forbidden surface; `None` if none is forbidden.
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

    /// True only if no part of the hand goes through another.
    pub(super) fn is_clear_of_itself(&self) -> bool {
        self_clearance(self.around.rig, &self.solids) >= 0.0
    }

    /// The closest parts that can meet; `None` if none can.
    pub(super) fn closest_parts(&self) -> Option<ClosestParts> {
        let NearestParts {
            clearance,
            rest_overlap,
            parts: [(part, our), (other, their)],
        } = NearestParts::of(self.around.rig, &self.solids)?;
        let nearest = NearestPart {
            distance: clearance - SOFT_CONTACT,
            part,
            at: skin_toward_solid(&our, &their),
        };
        Some(ClosestParts {
            nearest,
            other,
            rest_overlap,
        })
    }

    /// True only if the hand keeps off forbidden surfaces.
    pub(super) fn is_clear_of_forbidden(&self) -> bool {
        let object = self.around.object.object;
        let mut parts = self.solids.iter();
        !parts.any(|part| object.is_forbidden_within(part, FORBIDDEN_CLEARANCE + GAP_SLACK))
    }

    /// The receiver's arm; `None` if where the receiver stands is unknown, or if the arm does not reach the wrist.
    pub(super) fn arm(&self) -> Option<ArmPose> {
        let around = &self.around;
        around
            .presented
            .arm_of(around.object.object, around.rig, self.pose.frame_from_wrist)
    }

    /// If the receiver's arm must reach the wrist: the distance from its shoulder and the length of its bones, in metres, and
    /// whether this arm, from [`Self::arm`], does.
    pub(super) fn reach(&self, arm: Option<&ArmPose>) -> Option<Measure> {
        let receiver = &self.around.presented.receiver;
        let [distance, longest] = receiver.shoulder_distance(self.pose.frame_from_wrist)?;
        Some(Measure::new(distance, longest, self.around.is_reached(arm)))
    }

    /// The distance from the shoulder of the requirements, if they have one.
    pub(super) fn constrained_reach(&self) -> Option<Measure> {
        let wrist = self.pose.frame_from_wrist;
        let reach = self.around.requirements.reach?;
        let distance = reach.shoulder.distance(wrist.position);
        Some(Measure::new(distance, reach.distance, reach.admits(wrist)))
    }
}

/// The depth in the object, 0 if no part is in it.
pub(super) fn depth(deepest: Option<&NearestPart>) -> Measure {
    let depth = deepest.map_or(0.0, |deepest| -deepest.distance);
    Measure::new(depth, MAX_PENETRATION, depth <= MAX_PENETRATION + ROUNDING)
}

/// The distance from a barrier.
pub(super) fn clearance(nearest: &Nearest) -> Measure {
    let bound = match nearest.barrier {
        Barrier::PresentingHand | Barrier::OtherHand(_) => GIVER_CLEARANCE,
        Barrier::Obstacle(_) => OBSTACLE_CLEARANCE,
    };
    Measure::at_least(nearest.distance, bound)
}

/// A posed hand with its contacts.
pub(super) struct Held<'a> {
    pub(super) hold: PosedHold,
    pub(super) contacts: &'a [Contact],
    reading: &'a Reading<'a>,
}

impl Reading<'_> {
    /// How the hand holds the object, whatever it collides with. Something hangs in it only if the requirements admit that.
    pub(super) fn held<'b>(&'b self, gripper: &'b mut Gripper) -> Held<'b> {
        let GraspContext {
            object,
            presented,
            rig,
            requirements,
        } = self.around;
        let may_hang = |contacts: &[Contact], balance: &Balance| {
            requirements.admits_type(Some(GraspType::FixedHook))
                && requirements.admits_comfort(comfort_of(contacts, balance))
        };
        Held {
            hold: gripper.hold_as_posed(&object, rig, self.pose, presented, may_hang),
            contacts: &gripper.contacts,
            reading: self,
        }
    }
}

impl Held<'_> {
    /// The number of contacts.
    pub(super) fn contacts(&self) -> Measure {
        let count = self.contacts.len();
        Measure::new(count as f32, FEWEST_CONTACTS as f32, count >= FEWEST_CONTACTS)
    }

    /// The unbalanced share of the weight.
    pub(super) fn balance(&self) -> Measure {
        let residual = self.hold.balance.residual;
        Measure::new(residual, BALANCE_TOLERANCE, residual <= BALANCE_TOLERANCE)
    }

    /// The type of the hand.
    pub(super) fn classification(&self) -> Classification {
        let Reading { around, pose, .. } = self.reading;
        around.classification(pose, self.contacts, self.hold.hangs())
    }

    /// True if the requirements admit the comfort of the forces.
    pub(super) fn is_comfort_admitted(&self) -> bool {
        let comfort = comfort_of(self.contacts, &self.hold.balance);
        self.reading.around.requirements.admits_comfort(comfort)
    }

    /// The hand as a grasp of this type, without a score.
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
            // Nobody closed it by a ratio.
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

    /// A grasp from [`Self::grasp`] with its score.
    pub(super) fn scored(&self, grasp: Grasp) -> Grasp {
        let Reading { around, solids, .. } = self.reading;
        around.scored(grasp, self.hold.relative_closure, solids)
    }
}

fn comfort_of(contacts: &[Contact], balance: &Balance) -> f32 {
    comfort(digit_totals(contacts, &balance.forces))
}
