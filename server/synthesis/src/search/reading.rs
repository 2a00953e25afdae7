//! A hand that no search closed, as it is checked: the one place where current grasps and clients' own are measured.
//!
//! A current grasp fails by the first check that fails ([`super::current`]), while verdicts need all of them
//! ([`super::verdicts`]). Both take figures, bounds and decisions from here. The bounds are those of the searches' own checks, and
//! the figures come from the functions that these decide by. Whatever takes long to measure has a test that says sooner that a hand
//! is certainly clear.

mod held;

use glam::Vec3;

use crate::{
    base::stop::{Stop, Stopped},
    model::{
        hand::HandPose,
        holdout::{ArmPose, Holdout},
    },
    physical::{
        barriers::{
            Barrier, BarrierClearances, Nearest, OBSTACLE_CLEARANCE, nearest_hand, nearest_obstacle,
            skin_toward_solid,
        },
        grip::{FORBIDDEN_CLEARANCE, GIVER_CLEARANCE, MAX_PENETRATION, clear_of_barriers},
        solids::{HandSolids, NearestParts, SOFT_CONTACT, SolidPart, TrackedSolids, closest, self_clearance},
    },
    rating::assessment::GraspContext,
};

pub(super) use held::Held;

/// By how much, in metres, distances may fall short of their bounds: a grasp that was valid loses so much to single precision on
/// its way through a client's frame.
const ROUNDING: f32 = 5e-6;

/// How much closer than measured a forbidden surface may be, in metres; see [`crate::geometry::mesh_bvh::MeshBvh::closest_to_capsule`].
const GAP_SLACK: f32 = 2e-5;

/// A figure, its bound, and whether it keeps that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measure {
    pub(super) figure: f32,
    pub(super) bound: f32,
    pub(super) passed: bool,
}

impl Measure {
    /// A distance in metres that must not be less than its bound.
    fn at_least(figure: f32, bound: f32) -> Self {
        Self {
            figure,
            bound,
            passed: figure >= bound - ROUNDING,
        }
    }

    /// A depth in metres that must not be more than its bound.
    fn at_most(figure: f32, bound: f32) -> Self {
        Self {
            figure,
            bound,
            passed: figure <= bound + ROUNDING,
        }
    }
}

/// The deepest part of a hand in the object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Deepest {
    /// In metres, positive.
    pub(super) depth: f32,
    pub(super) part: SolidPart,
    /// A point of the surface, in the object's frame.
    pub(super) at: Vec3,
}

/// The two parts of a hand that can meet and come closest.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClosestParts {
    /// In metres, negative where they overlap more than at rest.
    pub(super) distance: f32,
    /// How deep they overlap at rest, in metres.
    pub(super) rest_overlap: f32,
    pub(super) part: SolidPart,
    pub(super) other: SolidPart,
    /// A point of the part's skin, in the object's frame.
    pub(super) at: Vec3,
}

/// The part of a hand that is nearest to a forbidden surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct NearestForbidden {
    /// In metres, negative inside.
    pub(super) distance: f32,
    pub(super) part: SolidPart,
    /// A point of the surface, in the object's frame.
    pub(super) at: Vec3,
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
    pub(super) fn deepest(&self, stop: Stop<'_>) -> Result<Option<Deepest>, Stopped> {
        let surface = &self.around.object.object.surface;
        let mut deepest: Option<Deepest> = None;
        for (part, solid) in self.solids.parts() {
            stop.check()?;
            let least = deepest.map_or(0.0, |deepest| -deepest.depth);
            let touch = closest(solid, surface, least);
            if let Some(touch) = touch.filter(|touch| touch.clearance < least) {
                deepest = Some(Deepest {
                    depth: -touch.clearance,
                    part,
                    at: touch.point,
                });
            }
        }
        Ok(deepest)
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
        Some(ClosestParts {
            distance: clearance - SOFT_CONTACT,
            rest_overlap,
            part,
            other,
            at: skin_toward_solid(&our, &their),
        })
    }

    /// True only if the hand keeps off forbidden surfaces.
    pub(super) fn is_clear_of_forbidden(&self) -> bool {
        let object = self.around.object.object;
        let mut parts = self.solids.iter();
        !parts.any(|part| object.is_forbidden_within(part, FORBIDDEN_CLEARANCE + GAP_SLACK))
    }

    /// The part nearest to a forbidden surface; `None` if none is forbidden.
    pub(super) fn nearest_forbidden(&self) -> Option<NearestForbidden> {
        let surface = self.around.object.object.forbidden_surface()?;
        let mut nearest: Option<NearestForbidden> = None;
        for (part, solid) in self.solids.parts() {
            let least = nearest.map_or(f32::INFINITY, |nearest| nearest.distance);
            let gap = surface.closest_to_capsule(solid, least);
            if let Some(gap) = gap.filter(|gap| gap.gap < least) {
                nearest = Some(NearestForbidden {
                    distance: gap.gap,
                    part,
                    at: gap.position,
                });
            }
        }
        nearest
    }

    /// The receiver's arm; `None` if where the receiver stands is unknown, or if the arm does not reach the wrist.
    pub(super) fn arm(&self) -> Option<ArmPose> {
        let GraspContext {
            object,
            presented,
            rig,
            ..
        } = self.around;
        presented.arm_of(object.object, rig, self.pose.frame_from_wrist)
    }

    /// If the receiver's arm must reach the wrist: the distance from its shoulder and the length of its bones, in metres, and
    /// whether this arm, from [`Self::arm`], does.
    pub(super) fn reach(&self, arm: Option<&ArmPose>) -> Option<Measure> {
        let receiver = &self.around.presented.receiver;
        let [distance, longest] = receiver.shoulder_distance(self.pose.frame_from_wrist)?;
        Some(Measure {
            figure: distance,
            bound: longest,
            passed: self.around.is_reached(arm),
        })
    }

    /// The distance from the shoulder of the requirements, if they have one.
    pub(super) fn constrained_reach(&self) -> Option<Measure> {
        let wrist = self.pose.frame_from_wrist;
        let reach = self.around.requirements.reach?;
        Some(Measure {
            figure: reach.shoulder.distance(wrist.position),
            bound: reach.distance,
            passed: reach.admits(wrist),
        })
    }

    /// True if the requirements admit the hand's approach.
    pub(super) fn is_approach_admitted(&self) -> bool {
        self.around
            .requirements
            .admits_approach(self.pose.frame_from_wrist)
    }

    /// True unless the wrist is near that of a banned grip.
    pub(super) fn is_not_banned(&self) -> bool {
        self.around.is_not_banned(self.pose.frame_from_wrist)
    }
}

impl Deepest {
    /// The depth, 0 if no part is in the object.
    pub(super) fn measure(deepest: Option<&Self>) -> Measure {
        Measure::at_most(deepest.map_or(0.0, |deepest| deepest.depth), MAX_PENETRATION)
    }
}

impl ClosestParts {
    pub(super) fn measure(&self) -> Measure {
        Measure::at_least(self.distance, -SOFT_CONTACT)
    }
}

impl NearestForbidden {
    pub(super) fn measure(&self) -> Measure {
        Measure::at_least(self.distance, FORBIDDEN_CLEARANCE)
    }
}

/// The distance from a barrier.
pub(super) fn clearance(nearest: &Nearest) -> Measure {
    let bound = match nearest.barrier {
        Barrier::PresentingHand | Barrier::OtherHand(_) => GIVER_CLEARANCE,
        Barrier::Obstacle(_) => OBSTACLE_CLEARANCE,
    };
    Measure::at_least(nearest.distance, bound)
}
