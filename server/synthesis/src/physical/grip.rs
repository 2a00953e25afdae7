//! A grip: a hand closed on an object, independent of the giver's pose and, unless the object hangs in it, of gravity.
//! Steps 2 to 4 of Algorithm 1 with the hand as solids, and closure.
//!
//! Checks run in order of cost: palm and forearm before any digit closes, and those that reject most hands first. Half
//! of the hands that close on something cannot hold it, so idle fingers come to rest only after closure is known.

mod posed_hand;

use glam::Vec3;

pub use self::posed_hand::{FEWEST_CONTACTS, Misfit, PosedDigits, PosedHold};

use super::{
    barriers::{BarrierClearances, Barriers},
    closer::{Closer, Obstacle},
    closing::{COARSE_GAP, ClosedDigit, MAX_STEPS, SEARCH_DISTANCE, TOUCH_DEPTH, TOUCH_TOLERANCE},
    contacts::{are_opposed, collect_contacts, soften},
    hanging::Hang,
    immobility::{Buffers, SoftContact, TorqueScale, epsilon},
    presented::{ObjectScene, Presented},
    shape::Proposal,
    solids::{HandSolids, TaperedCapsule, TrackedSolids, clearance, comes_within, self_clearance},
};
use crate::{
    base::{
        pose::Pose,
        rejection::{Failure, Rejection},
        stop::Stop,
        stopwatch::{Step, Stopwatch},
    },
    model::{
        grasp::Contact,
        hand::{Digit, DigitAngles, HandPose, rig::Rig},
    },
};

/// Deepest penetration of any part of the hand into the rigid object, in metres: soft flesh yields by about as much
/// under a firm grip. Larger values let hands look sunken.
pub const MAX_PENETRATION: f32 = 0.002;

/// Clearance between the receiving hand and forearm and other hands, in metres; [`Barriers`] lets obstacles be closer. Larger
/// values are safer and find fewer grasps.
pub const GIVER_CLEARANCE: f32 = 0.001;

/// Clearance between the hand and forbidden surfaces, in metres: flesh may yield by two millimetres, and skin is one
/// thicker than the solids.
pub const FORBIDDEN_CLEARANCE: f32 = 0.003;

/// Share of the required closure, by an upper bound, from which a rejected hand is a near miss.
const NEAR_MISS_SHARE: f32 = 0.3;

/// A hand closed on an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Grip {
    /// The hand's pose in the object's frame.
    pub pose: HandPose,
    /// The bend ratio each digit closed with, thumb first; `None` for a digit that does not touch.
    pub bend_ratios: [Option<f32>; 5],
    /// Deepest penetration into the object in metres, 0 if there is none.
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

/// Closes hands. Keeps its buffers from one call to the next.
#[derive(Clone, Debug, Default)]
pub struct Gripper {
    /// Joint angles of the digits posed so far, thumb first.
    pub posed: Vec<DigitAngles>,
    /// Contacts of the hand.
    pub contacts: Vec<Contact>,
    /// Whether another hand holds, too: closure is left to [`super::both_hands`], and epsilon is 0.
    is_shared: bool,
    /// Whether the touch of an idle digit at rest counts as contact.
    counts_resting: bool,
    obstacles: Vec<Obstacle>,
    pub(crate) soft_contacts: Vec<SoftContact>,
    pub(crate) buffers: Buffers,
    /// How the object hangs in the last hand; `None` if its contacts have closure.
    pub(crate) hang: Option<Hang>,
    /// Closure of the last hand as a share of the required one: an upper bound if below 1, 0 if no hand came that far.
    closure_share: f32,
}

impl Gripper {
    /// Closes hands that hold together with another.
    pub fn sharing() -> Self {
        Self {
            is_shared: true,
            ..Self::default()
        }
    }

    /// Closes hands for answers. An idle digit that has no room and rests on the object holds it; grips in atlases ignore such
    /// digits.
    pub fn answering() -> Self {
        Self {
            counts_resting: true,
            ..Self::default()
        }
    }

    /// Closes a proposed hand; its contacts are in `contacts` afterwards. With `presented`, hands that come too close
    /// to its barriers are rejected on the way.
    ///
    /// # Errors
    /// The first check that fails, or the stop signal.
    pub fn grip(
        &mut self,
        scene: &ObjectScene<'_>,
        rig: &Rig,
        proposal: &Proposal,
        presented: Option<&Presented>,
        stopwatch: &mut Stopwatch<'_>,
        stop: Stop<'_>,
    ) -> Result<(Grip, HandSolids), Failure> {
        self.posed.clear();
        self.closure_share = 0.0;
        self.hang = None;
        let barriers = presented.map_or(Barriers::NONE, Presented::barriers);

        // Steps 3 and 4 for palm and forearm, which do not move with the digits, and for the ball of the thumb in its
        // start pose.
        let Proposal { shape, advance, .. } = proposal;
        let opened = opened(rig, proposal);
        let mut still = HandSolids::of_pose(rig, &opened);
        let mut object_from_wrist = proposal.object_from_wrist;
        if *advance > 0.0 {
            let Some(offset) = palm_advance(scene, &still, object_from_wrist, *advance) else {
                stopwatch.lap(Step::CollisionValidation);
                return Err(Rejection::PalmCollision.into());
            };
            object_from_wrist.position += offset;
            still = still.moved(offset);
        }
        let collides = collides_without_digits(
            scene,
            barriers,
            &TrackedSolids::of_rig(rig, object_from_wrist, &still),
        );
        stopwatch.lap(Step::CollisionValidation);
        if collides {
            return Err(Rejection::PalmCollision.into());
        }
        if nears_forbidden_surface(scene, still.palm.iter().chain(&still.thenar)) {
            stopwatch.lap(Step::ContactValidation);
            return Err(Rejection::UnwantedContact.into());
        }

        // Step 2, Finger Posing.
        self.obstacles.clear();
        self.obstacles.extend(Obstacle::of_palm(&still));
        let closer = Closer {
            scene,
            barriers,
            rig,
            shape,
            object_from_wrist,
        };
        let thumb = closer.close_thumb(&self.obstacles).map_err(Failure::from);
        let closed = thumb.and_then(|thumb| {
            let mut pose = HandPose {
                frame_from_wrist: object_from_wrist,
                ..opened
            };
            pose.digits[Digit::Thumb.index()] = thumb.angles;
            self.obstacles
                .extend(Obstacle::of_thumb(&HandSolids::of_pose(rig, &pose)));
            closer.close_fingers(thumb, &self.obstacles, stop)
        });
        stopwatch.lap(Step::FingerPosing);
        let closed = closed?;
        self.posed.extend(closed.iter().map(|digit| digit.angles));
        stop.check()?;

        // Step 4, Contact Validation, for the digits that touch.
        self.touch(&closer, &closed);
        stopwatch.lap(Step::ContactValidation);

        // Step 5, Immobility Validation: whether the contacts can hold anything.
        let up = presented.map(|presented| presented.up);
        let epsilon = self.enclosure(&closer, &closed, up);
        stopwatch.lap(Step::ImmobilityValidation);
        let epsilon = epsilon.ok_or(Rejection::NotImmobilizing)?;
        stop.check()?;

        // Step 2 for the fingers that hold nothing.
        let digits = closer.rest_idle(&closed, &self.obstacles);
        stopwatch.lap(Step::FingerPosing);
        // An idle finger without room rests on the object, and then holds it.
        let resting = if self.counts_resting {
            closer.touching(&digits)
        } else {
            digits
        };
        let epsilon = if resting == digits {
            epsilon
        } else {
            self.touch(&closer, &resting);
            let again = self.enclosure(&closer, &resting, up);
            again.ok_or(Rejection::NotImmobilizing)?
        };
        Ok(self.validate(&closer, &resting, epsilon, stopwatch)?)
    }

    /// Finds the contacts of a hand with these digits.
    fn touch(&mut self, closer: &Closer<'_>, digits: &[ClosedDigit; 5]) {
        let Closer { scene, rig, .. } = closer;
        collect_contacts(
            scene.object,
            rig,
            &closer.pose(digits),
            digits,
            &mut self.contacts,
        );
        soften(&self.contacts, scene.friction, &mut self.soft_contacts);
    }

    /// Every check but closure, for a hand whose digits are all posed and whose contacts have this epsilon.
    fn validate(
        &mut self,
        closer: &Closer<'_>,
        digits: &[ClosedDigit; 5],
        epsilon: f32,
        stopwatch: &mut Stopwatch<'_>,
    ) -> Result<(Grip, HandSolids), Rejection> {
        let Closer {
            scene,
            barriers,
            rig,
            shape,
            ..
        } = closer;
        self.posed.clear();
        self.posed.extend(digits.iter().map(|digit| digit.angles));

        // Step 3, Collision Validation.
        let pose = closer.pose(digits);
        let solids = HandSolids::of_pose(rig, &pose);
        let penetration = penetration(scene, rig, *barriers, &solids);
        stopwatch.lap(Step::CollisionValidation);
        let penetration = penetration.ok_or(Rejection::FingerCollision)?;

        // Step 4 for the whole hand.
        let touches_forbidden = nears_forbidden_surface(scene, solids.iter());
        stopwatch.lap(Step::ContactValidation);
        if touches_forbidden {
            return Err(Rejection::UnwantedContact);
        }
        let bend_ratios = std::array::from_fn(|digit| {
            digits[digit]
                .touches_object()
                .then_some(shape.flexing(rig, Digit::ALL[digit]).bend_ratio)
        });
        let grip = Grip {
            pose,
            bend_ratios,
            penetration,
            epsilon,
        };
        Ok((grip, solids))
    }

    /// The epsilon of the contacts if they have closure or the object hangs, which needs `up`; 0 if another hand helps.
    fn enclosure(&mut self, closer: &Closer<'_>, closed: &[ClosedDigit; 5], up: Option<Vec3>) -> Option<f32> {
        let Closer { scene, shape, .. } = closer;
        if self.is_shared {
            return Some(0.0);
        }
        if !shape.is_hook() {
            return self.opposed_closure(scene);
        }
        // Fingers that should hook but hold nothing point past the handle; one such finger looks natural.
        let closing = (1..5).filter(|&finger| shape.closing[finger]);
        let touching = closing.clone().filter(|&finger| closed[finger].touches_object());
        let enough_touch = touching.count() >= closing.count().min(3);
        let hooks = enough_touch && !closed[Digit::Thumb.index()].touches_object();
        up.filter(|_| hooks).and_then(|up| self.hang(scene, closed, up))
    }

    /// The epsilon of the contacts if the object hangs in closed digits.
    fn hang(&mut self, scene: &ObjectScene<'_>, closed: &[ClosedDigit; 5], up: Vec3) -> Option<f32> {
        self.hang = Hang::of(&self.contacts, closed, scene.object.centre_of_mass, up);
        self.hang?;
        let load = scene.load(&self.soft_contacts, up);
        Some(epsilon(&self.soft_contacts, &load, 0.0, &mut self.buffers))
    }

    /// [`Self::closure`], unless it is clear at once that nothing can be held.
    fn opposed_closure(&mut self, scene: &ObjectScene<'_>) -> Option<f32> {
        are_opposed(&self.contacts).then(|| self.closure(scene)).flatten()
    }

    /// Ferrari-Canny epsilon of the contacts, if it reaches the required one.
    pub fn closure(&mut self, scene: &ObjectScene<'_>) -> Option<f32> {
        // Closure does not depend on the direction of gravity.
        let load = scene.load(&self.soft_contacts, Vec3::Y);
        let required = scene.required_epsilon(&load.torque_scale);
        let epsilon = epsilon(&self.soft_contacts, &load, required, &mut self.buffers);
        self.closure_share = epsilon / required;
        (epsilon > 0.0 && epsilon >= required).then_some(epsilon)
    }

    /// The epsilon of the last hand's contacts as a multiple of the required one.
    pub(crate) fn relative_closure(&self, scene: &ObjectScene<'_>, epsilon: f32) -> f32 {
        epsilon / scene.required_epsilon(&TorqueScale::of(&self.soft_contacts))
    }

    /// After a rejected hand: an upper bound of its closure as a share of the required one, if that makes it a near miss.
    pub(crate) fn near_miss(&self) -> Option<f32> {
        (NEAR_MISS_SHARE..1.0)
            .contains(&self.closure_share)
            .then_some(self.closure_share)
    }
}

/// A hand's distances from its barriers: `None` if it is too close to one.
pub fn clear_of_barriers(hand: &TrackedSolids, barriers: Barriers<'_>) -> Option<BarrierClearances> {
    barriers.clearances(hand, GIVER_CLEARANCE)
}

/// The wrist pose of a proposal after its advance; `None` if the palm touches nothing within it.
pub(crate) fn wrist_after_advance(scene: &ObjectScene<'_>, rig: &Rig, proposal: &Proposal) -> Option<Pose> {
    let wrist = proposal.object_from_wrist;
    if proposal.advance <= 0.0 {
        return Some(wrist);
    }
    let still = HandSolids::of_pose(rig, &opened(rig, proposal));
    let offset = palm_advance(scene, &still, wrist, proposal.advance)?;
    Some(Pose::new(wrist.position + offset, wrist.orientation))
}

/// The proposed hand with its digits opened.
fn opened(rig: &Rig, proposal: &Proposal) -> HandPose {
    HandPose {
        frame_from_wrist: proposal.object_from_wrist,
        digits: Digit::ALL.map(|digit| proposal.shape.flexing(rig, digit).opened()),
    }
}

/// The offset along the wrist's +z at which palm or thenar touch; `None` if they start inside or touch nothing.
fn palm_advance(
    scene: &ObjectScene<'_>,
    still: &HandSolids,
    object_from_wrist: Pose,
    max_advance: f32,
) -> Option<Vec3> {
    let direction = object_from_wrist.transform_vector(Vec3::Z);
    let surface = &scene.object.surface;
    let mut advanced = 0.0;
    for _ in 0..MAX_STEPS {
        let moved = still.moved(direction * advanced);
        let parts = moved.palm.iter().chain(&moved.thenar);
        let reachable = max_advance - advanced + TOUCH_DEPTH;
        let lower_bound = parts
            .clone()
            .fold(reachable, |least, part| least.min(surface.gap_lower_bound(part)));
        let gap = if lower_bound > COARSE_GAP {
            lower_bound
        } else {
            parts.fold(reachable.min(SEARCH_DISTANCE), |least, part| {
                surface
                    .closest_to_capsule(part, least)
                    .map_or(least, |gap| gap.gap)
            })
        };
        if advanced + gap >= max_advance {
            return None;
        }
        let free = gap + TOUCH_DEPTH;
        if free < TOUCH_TOLERANCE {
            return (free > -TOUCH_TOLERANCE).then_some(direction * advanced);
        }
        advanced += free;
    }
    Some(direction * advanced)
}

/// True if palm or forearm penetrate the object or come too close to a barrier.
fn collides_without_digits(scene: &ObjectScene<'_>, barriers: Barriers<'_>, still: &TrackedSolids) -> bool {
    let HandSolids { palm, forearm, .. } = &still.hand;
    let surface = &scene.object.surface;
    palm.iter()
        .chain(forearm)
        .any(|part| comes_within(part, surface, -MAX_PENETRATION))
        || barriers.comes_within(still.still(), GIVER_CLEARANCE)
}

/// The deepest penetration in metres; `None` if too deep, too close to a barrier, or if the hand goes through itself.
fn penetration(
    scene: &ObjectScene<'_>,
    rig: &Rig,
    barriers: Barriers<'_>,
    solids: &HandSolids,
) -> Option<f32> {
    if self_clearance(rig, solids) < 0.0 {
        return None;
    }
    // Palm and forearm were checked before the digits closed.
    let moving = solids.phalanges.as_flattened().iter().chain(&solids.thenar);
    if barriers.comes_within(moving, GIVER_CLEARANCE) {
        return None;
    }
    let surface = &scene.object.surface;
    let deepest = solids.iter().try_fold(0.0, |least: f32, part| {
        let least = clearance(part, surface, least).min(least);
        (least >= -MAX_PENETRATION).then_some(least)
    });
    deepest.map(|least| -least)
}

/// True if a part comes within [`FORBIDDEN_CLEARANCE`] of a forbidden surface.
pub(super) fn nears_forbidden_surface<'a>(
    scene: &ObjectScene<'_>,
    mut parts: impl Iterator<Item = &'a TaperedCapsule>,
) -> bool {
    parts.any(|part| scene.object.is_forbidden_within(part, FORBIDDEN_CLEARANCE))
}
