//! A grip: a hand closed on an object, whoever holds it out and wherever gravity pulls. Steps 2 to 4 of Algorithm 1 with
//! the hand as solids, and closure.
//!
//! The checks come by cost: palm and forearm before any digit closes, what settles most hands before what settles few.
//! Half of the hands that close on something touch it where they cannot hold it; fingers that hold nothing are rested
//! after that is known.

use glam::Vec3;

use super::{
    closer::Closer,
    closing::{ClosedDigit, MOST_STEPS, NEAR, SURE_GAP, TOUCH_DEPTH, TOUCH_TOLERANCE},
    contacts::{are_opposed, collect_contacts, soften},
    immobility::{Buffers, SoftContact, epsilon},
    obstacle::Obstacle,
    scene::{ObjectScene, Presented},
    shape::Proposal,
    solids::{
        HandSolids, PreparedHand, TaperedCapsule, TrackedSolids, clearance, comes_within, self_clearance,
    },
};
use crate::{
    base::{
        pose::Pose,
        rejection::Rejection,
        stopwatch::{Step, Stopwatch},
    },
    model::{
        grasp::Contact,
        hand::{Digit, DigitAngles, HandPose, rig::Rig},
    },
};

/// How deep any part of the hand may sink into the rigid object, in metres: soft flesh gives way by about as much under
/// a firm grip. More lets hands look sunken.
pub const DEEPEST: f32 = 0.002;

/// How far the receiving hand and forearm stay from the giver's, in metres. More is safer and finds fewer grasps.
pub const GIVER_CLEARANCE: f32 = 0.001;

/// How far the hand stays from forbidden surfaces, in metres: none of them is touched if flesh gives way by two, and skin is
/// one thicker than the solids.
pub const FORBIDDEN_CLEARANCE: f32 = 0.003;

/// The share of enough closure, by a bound from above, from which a hand is a near miss. Less closure says little of what
/// there is beside it.
const NEARLY: f32 = 0.3;

/// Why a hand was not closed to a grip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoGrip {
    /// A check failed.
    Rejected(Rejection),
    /// The stop signal came before it was over.
    Interrupted,
}

/// A hand closed on an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Grip {
    /// The hand in the object's frame.
    pub pose: HandPose,
    /// The bend ratio that each digit was closed with, thumb first; none where the digit does not touch.
    pub bend_ratios: [Option<f32>; 5],
    /// How deep it sinks into the object at its deepest, in metres; 0 if it does nowhere.
    pub penetration: f32,
    /// Ferrari-Canny epsilon of its contacts.
    pub epsilon: f32,
}

impl Grip {
    /// Which digits hold, thumb first.
    pub fn holding_digits(&self) -> [bool; 5] {
        self.bend_ratios.map(|ratio| ratio.is_some())
    }
}

/// A hand of which all is in order but that its closure is not known.
#[derive(Clone, Debug)]
pub(super) struct Posed {
    pose: HandPose,
    bend_ratios: [Option<f32>; 5],
    penetration: f32,
    solids: HandSolids,
}

impl Posed {
    /// The grip that it is with an epsilon, and its solids.
    pub(super) fn with_closure(self, epsilon: f32) -> (Grip, HandSolids) {
        let Self {
            pose,
            bend_ratios,
            penetration,
            solids,
        } = self;
        let grip = Grip {
            pose,
            bend_ratios,
            penetration,
            epsilon,
        };
        (grip, solids)
    }
}

/// Closes hands, and keeps its buffers from one to the next.
#[derive(Clone, Debug, Default)]
pub struct Gripper {
    /// Joint angles of the digits that were posed, thumb first.
    pub posed: Vec<DigitAngles>,
    /// Where the hand touches.
    pub contacts: Vec<Contact>,
    pub(super) obstacles: Vec<Obstacle>,
    pub(crate) soft_contacts: Vec<SoftContact>,
    pub(crate) buffers: Buffers,
    /// The closure that was found last, as a share of what is enough; a bound from above where it is not. 0 before a hand
    /// has come that far.
    closure_share: f32,
}

impl Gripper {
    /// Closes a proposed hand. What it touches is in `contacts` afterwards. With `presented`, a hand that
    /// comes too near to the giver's is refused on the way.
    ///
    /// # Errors
    /// The first check that fails, or the stop signal.
    pub fn grip(
        &mut self,
        scene: &ObjectScene<'_>,
        rig: &Rig,
        proposal: &Proposal,
        presented: Option<&Presented>,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> Result<(Grip, HandSolids), NoGrip> {
        self.posed.clear();
        self.closure_share = 0.0;
        let giver = presented.and_then(|presented| presented.giver.as_ref());

        // Steps 3 and 4 for palm and forearm, which do not move, and for the ball of the thumb where it starts.
        let Proposal { shape, advance, .. } = proposal;
        let opened = HandPose {
            frame_from_wrist: proposal.object_from_wrist,
            digits: Digit::ALL.map(|digit| shape.flexing(rig, digit).opened()),
        };
        let mut still = HandSolids::of_pose(rig, &opened);
        let mut object_from_wrist = proposal.object_from_wrist;
        if *advance > 0.0 {
            let Some(way) = free_way(
                scene,
                &still,
                object_from_wrist.transform_vector(Vec3::Z),
                *advance,
            ) else {
                stopwatch.lap(Step::CollisionValidation);
                return Err(NoGrip::Rejected(Rejection::PalmCollision));
            };
            object_from_wrist.position += way;
            still = still.moved(way);
        }
        let collides = collides_without_digits(
            scene,
            giver,
            &TrackedSolids::of_rig(rig, object_from_wrist, &still),
        );
        stopwatch.lap(Step::CollisionValidation);
        if collides {
            return Err(NoGrip::Rejected(Rejection::PalmCollision));
        }
        if nears_forbidden_surface(scene, still.palm.iter().chain(&still.thenar)) {
            stopwatch.lap(Step::ContactValidation);
            return Err(NoGrip::Rejected(Rejection::UnwantedContact));
        }

        // Step 2, Finger Posing.
        self.obstacles.clear();
        self.obstacles.extend(Obstacle::of_palm(&still));
        let closer = Closer {
            scene,
            giver,
            rig,
            shape,
            object_from_wrist,
        };
        let closed = closer.close_thumb(&self.obstacles).and_then(|thumb| {
            let mut pose = HandPose {
                frame_from_wrist: object_from_wrist,
                ..opened
            };
            pose.digits[Digit::Thumb.index()] = thumb.angles;
            self.obstacles
                .extend(Obstacle::of_thumb(&HandSolids::of_pose(rig, &pose)));
            closer.close_fingers(thumb, &self.obstacles, interrupted)
        });
        stopwatch.lap(Step::FingerPosing);
        let closed = closed?;
        self.posed.extend(closed.iter().map(|digit| digit.angles));
        if interrupted() {
            return Err(NoGrip::Interrupted);
        }

        // Step 4, Contact Validation, for the digits that hold.
        collect_contacts(
            scene.object,
            rig,
            &closer.pose(&closed),
            &closed,
            &mut self.contacts,
        );
        soften(&self.contacts, scene.friction, &mut self.soft_contacts);
        stopwatch.lap(Step::ContactValidation);

        // Step 5, Immobility Validation: whether they can hold anything.
        let epsilon = are_opposed(&self.contacts).then(|| self.closure(scene)).flatten();
        stopwatch.lap(Step::ImmobilityValidation);
        let epsilon = epsilon.ok_or(NoGrip::Rejected(Rejection::NotImmobilizing))?;
        if interrupted() {
            return Err(NoGrip::Interrupted);
        }

        // Step 2 for the fingers that hold nothing.
        let digits = closer.rest_idle(&closed, &self.obstacles);
        stopwatch.lap(Step::FingerPosing);
        let posed = self.validate(&closer, &digits, stopwatch)?;
        Ok(posed.with_closure(epsilon))
    }

    /// The checks of a hand whose digits are all posed, but for closure.
    pub(super) fn validate(
        &mut self,
        closer: &Closer<'_>,
        digits: &[ClosedDigit; 5],
        stopwatch: &mut impl Stopwatch,
    ) -> Result<Posed, NoGrip> {
        let Closer {
            scene,
            giver,
            rig,
            shape,
            ..
        } = closer;
        self.posed.clear();
        self.posed.extend(digits.iter().map(|digit| digit.angles));

        // Step 3, Collision Validation.
        let pose = closer.pose(digits);
        let solids = HandSolids::of_pose(rig, &pose);
        let penetration = penetration(scene, *giver, &solids);
        stopwatch.lap(Step::CollisionValidation);
        let penetration = penetration.ok_or(NoGrip::Rejected(Rejection::FingerCollision))?;

        // Step 4 for the whole hand.
        let is_unwanted = nears_forbidden_surface(scene, solids.iter());
        stopwatch.lap(Step::ContactValidation);
        if is_unwanted {
            return Err(NoGrip::Rejected(Rejection::UnwantedContact));
        }
        let bend_ratios = std::array::from_fn(|digit| {
            digits[digit]
                .touches_object()
                .then_some(shape.flexing(rig, Digit::ALL[digit]).bend_ratio)
        });
        Ok(Posed {
            pose,
            bend_ratios,
            penetration,
            solids,
        })
    }

    /// The closure of the contacts, if it is enough.
    pub fn closure(&mut self, scene: &ObjectScene<'_>) -> Option<f32> {
        // Closure is the same wherever gravity pulls.
        let load = scene.load(Vec3::Y);
        let epsilon = epsilon(&self.soft_contacts, &load, scene.least_epsilon, &mut self.buffers);
        self.closure_share = epsilon / scene.least_epsilon;
        (epsilon >= scene.least_epsilon).then_some(epsilon)
    }

    /// After a hand that was refused: at most how much of enough closure it has, if that is near.
    pub fn near_miss(&self) -> Option<f32> {
        (NEARLY..1.0)
            .contains(&self.closure_share)
            .then_some(self.closure_share)
    }
}

/// The distance of a hand from the giver's, if it is enough: `Some(None)` without a giver.
pub fn clear_of_giver(hand: &TrackedSolids, giver: Option<&PreparedHand>) -> Option<Option<f32>> {
    match giver {
        None => Some(None),
        Some(giver) => giver.clearance(hand, GIVER_CLEARANCE).map(Some),
    }
}

/// Where the wrist of a proposed hand is when its palm is laid on, if that is how it is to be; none if the palm does not
/// touch anything on its way.
pub fn settled_wrist(scene: &ObjectScene<'_>, rig: &Rig, proposal: &Proposal) -> Option<Pose> {
    let wrist = proposal.object_from_wrist;
    if proposal.advance <= 0.0 {
        return Some(wrist);
    }
    let opened = HandPose {
        frame_from_wrist: wrist,
        digits: Digit::ALL.map(|digit| proposal.shape.flexing(rig, digit).opened()),
    };
    let still = HandSolids::of_pose(rig, &opened);
    let way = free_way(scene, &still, wrist.transform_vector(Vec3::Z), proposal.advance)?;
    Some(Pose::new(wrist.position + way, wrist.orientation))
}

/// The way along `direction` after which palm or thenar touch, if they are free at first and touch within `most` metres.
fn free_way(scene: &ObjectScene<'_>, still: &HandSolids, direction: Vec3, most: f32) -> Option<Vec3> {
    let surface = &scene.object.surface;
    let mut way = 0.0;
    for _ in 0..MOST_STEPS {
        let moved = still.moved(direction * way);
        let parts = moved.palm.iter().chain(&moved.thenar);
        let reachable = most - way + TOUCH_DEPTH;
        let sure = parts
            .clone()
            .fold(reachable, |least, part| least.min(surface.gap_lower_bound(part)));
        let gap = if sure > SURE_GAP {
            sure
        } else {
            parts.fold(reachable.min(NEAR), |least, part| {
                surface
                    .closest_to_capsule(part, least)
                    .map_or(least, |gap| gap.gap)
            })
        };
        if way + gap >= most {
            return None;
        }
        let free = gap + TOUCH_DEPTH;
        if free < TOUCH_TOLERANCE {
            return (free > -TOUCH_TOLERANCE).then_some(direction * way);
        }
        way += free;
    }
    Some(direction * way)
}

/// True if palm or forearm sink into the object or come too near to the giver.
fn collides_without_digits(
    scene: &ObjectScene<'_>,
    giver: Option<&PreparedHand>,
    still: &TrackedSolids,
) -> bool {
    let HandSolids { palm, forearm, .. } = &still.hand;
    let surface = &scene.object.surface;
    palm.iter()
        .chain(forearm)
        .any(|part| comes_within(part, surface, -DEEPEST))
        || giver.is_some_and(|giver| giver.is_neared_by(still.still(), GIVER_CLEARANCE))
}

/// How deep the hand is in the object, if that, its distance from the giver's, and its parts' distances from each other
/// are in order.
fn penetration(scene: &ObjectScene<'_>, giver: Option<&PreparedHand>, solids: &HandSolids) -> Option<f32> {
    if self_clearance(solids) < 0.0 {
        return None;
    }
    // Palm and forearm were compared before the digits closed.
    let moving = solids.phalanges.as_flattened().iter().chain(&solids.thenar);
    if giver.is_some_and(|giver| giver.is_neared_by(moving, GIVER_CLEARANCE)) {
        return None;
    }
    let surface = &scene.object.surface;
    let deepest = solids.iter().try_fold(0.0, |least: f32, part| {
        let least = clearance(part, surface, least).min(least);
        (least >= -DEEPEST).then_some(least)
    });
    deepest.map(|least| -least)
}

/// True if a part comes too near to a forbidden surface.
pub(super) fn nears_forbidden_surface<'a>(
    scene: &ObjectScene<'_>,
    mut parts: impl Iterator<Item = &'a TaperedCapsule>,
) -> bool {
    parts.any(|part| scene.object.is_forbidden_within(part, FORBIDDEN_CLEARANCE))
}
