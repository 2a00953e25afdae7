//! Step 2 under `PHYSICAL` validity for all digits of one hand: thumb first, then fingers, then idle fingers come to
//! rest. The thumb of a hook rests first. Digits of a closed hand make way for barriers, too.

use super::{
    barriers::Barriers,
    closing::{COARSE_GAP, ClosedDigit, Closing},
    grip::{GIVER_CLEARANCE, nears_forbidden_surface},
    presented::ObjectScene,
    shape::{HandShape, TUCKED_FLEXION},
    solids::{
        Bounded, HandSolids, SOFT_CONTACT, TaperedCapsule, TrackedSolids, comes_within, link_radii,
        self_clearance,
    },
};
use crate::{
    base::{
        pose::Pose,
        rejection::{Failure, Rejection},
        stop::Stop,
    },
    model::hand::{
        Digit, DigitAngles, HandPose,
        kinematics::DigitPlane,
        rig::{AngleRange, PALM_PART, Rig, THUMB_BALL_PART},
    },
};

/// Flexions in radians that take an idle finger clear of the barriers: tucked into the palm or, else, nearly straight.
const EVASIVE_FLEXIONS: [f32; 2] = [TUCKED_FLEXION, 0.6];

/// Total flexion of a relaxed thumb, in radians: a thumb that lies next to the index finger is nearly straight.
const RESTING_THUMB_FLEXION: f32 = 0.35;

/// Closes the digits of a hand whose wrist is fixed.
#[derive(Debug)]
pub(super) struct Closer<'a> {
    /// The object being grasped.
    pub scene: &'a ObjectScene<'a>,
    /// The barriers that the hand keeps clear of.
    pub barriers: Barriers<'a>,
    /// The rig of the closing hand.
    pub rig: &'a Rig,
    /// The shape the hand closes from.
    pub shape: &'a HandShape,
    /// Its wrist pose, in the object's frame.
    pub object_from_wrist: Pose,
}

impl<'a> Closer<'a> {
    /// The closer of a posed hand's digits.
    pub(super) fn of_pose(
        scene: &'a ObjectScene<'a>,
        rig: &'a Rig,
        barriers: Barriers<'a>,
        shape: &'a HandShape,
        pose: &HandPose,
    ) -> Self {
        Self {
            scene,
            barriers,
            rig,
            shape,
            object_from_wrist: pose.frame_from_wrist,
        }
    }
    /// The hand pose with these digits.
    pub(super) fn pose(&self, digits: &[ClosedDigit; 5]) -> HandPose {
        HandPose {
            frame_from_wrist: self.object_from_wrist,
            digits: digits.map(|digit| digit.angles),
        }
    }

    /// A digit before it closes, with the shape's yaw or another one.
    pub(super) fn closing<'b>(
        &'b self,
        digit: Digit,
        yaw: Option<f32>,
        obstacles: &'b [Obstacle],
    ) -> Closing<'b> {
        let mut flexing = self.shape.flexing(self.rig, digit);
        flexing.base_yaw = yaw.unwrap_or(flexing.base_yaw);
        let rest_overlaps = self.rig.rest_overlaps.as_deref();
        Closing {
            surface: &self.scene.object.surface,
            flexing,
            radii: link_radii(self.rig, digit),
            plane: DigitPlane::new(flexing.digit, self.object_from_wrist, flexing.base_yaw),
            preshape: self.shape.preshape[usize::from(digit != Digit::Thumb)],
            obstacles,
            rest_overlaps: rest_overlaps.map(|overlaps| overlaps.of_digit(digit)),
            curls_last: self.shape.is_hook() && digit != Digit::Thumb,
        }
    }

    /// Closes a digit as far as it goes. `None` if it starts inside something or comes too close to a barrier.
    fn close(&self, digit: Digit, obstacles: &[Obstacle]) -> Option<ClosedDigit> {
        let closed = self.closing(digit, None, obstacles).close()?;
        self.is_clear(&closed).then_some(closed)
    }

    fn nears_forbidden(&self, digit: &ClosedDigit) -> bool {
        nears_forbidden_surface(self.scene, digit.links.iter())
    }

    /// True if a digit keeps [`GIVER_CLEARANCE`] from the barriers.
    pub(super) fn is_clear(&self, digit: &ClosedDigit) -> bool {
        !self.barriers.comes_within(digit.links.iter(), GIVER_CLEARANCE)
    }

    /// Closes the thumb, or rests it if the fingers hook.
    ///
    /// # Errors
    /// A closing thumb is blocked, does not touch the object, or comes too close to a forbidden surface.
    pub(super) fn close_thumb(&self, obstacles: &[Obstacle]) -> Result<ClosedDigit, Rejection> {
        if self.shape.is_hook() {
            return Ok(self.rest(Digit::Thumb, obstacles, RESTING_THUMB_FLEXION));
        }
        let thumb = self.close(Digit::Thumb, obstacles);
        let thumb = thumb.ok_or(Rejection::FingerCollision)?;
        if !thumb.touches_object() {
            Err(Rejection::NoThumbEarlyStop)
        } else if self.nears_forbidden(&thumb) {
            Err(Rejection::UnwantedContact)
        } else {
            Ok(thumb)
        }
    }

    /// Closes the fingers that the shape closes. A finger that is blocked or comes too close to a forbidden surface
    /// holds nothing.
    pub(super) fn close_fingers(
        &self,
        thumb: ClosedDigit,
        obstacles: &[Obstacle],
        stop: Stop<'_>,
    ) -> Result<[ClosedDigit; 5], Failure> {
        let mut closed = [ClosedDigit::default(); 5];
        closed[Digit::Thumb.index()] = thumb;
        let fingers = &Digit::ALL[1..];
        for &finger in fingers.iter().filter(|finger| self.shape.closing[finger.index()]) {
            stop.check()?;
            let free = self.close(finger, obstacles);
            let free = free.filter(|closed| !self.nears_forbidden(closed));
            closed[finger.index()] = free.unwrap_or_default();
        }
        if !closed[1..].iter().any(ClosedDigit::touches_object) {
            return Err(Rejection::NoFingers.into());
        }
        Ok(closed)
    }

    /// The digits, with fingers that hold nothing moved to rest. Missing ones stay as they are.
    pub(super) fn rest_idle(&self, closed: &[ClosedDigit; 5], obstacles: &[Obstacle]) -> [ClosedDigit; 5] {
        let mut rested = *closed;
        for finger in self.rig.fingers() {
            let place = finger.index();
            if !closed[place].touches_object() {
                let flexion = self.shape.resting_flexion(closed, place);
                rested[place] = self.rest(finger, obstacles, flexion);
            }
        }
        rested
    }

    /// The digits, unmoved, with their touches.
    pub(super) fn touching(&self, digits: &[ClosedDigit; 5]) -> [ClosedDigit; 5] {
        let mut touching = *digits;
        for digit in Digit::ALL.into_iter().filter(|&digit| self.rig.has(digit)) {
            let ClosedDigit { angles, links, .. } = digits[digit.index()];
            if !digits[digit.index()].touches_object() {
                touching[digit.index()] = ClosedDigit::as_posed(angles, links, &self.scene.object.surface);
            }
        }
        touching
    }

    /// A relaxed pose for a digit that holds nothing; where that is too close to a barrier, tucked away or nearly straight.
    fn rest(&self, digit: Digit, obstacles: &[Obstacle], flexion: f32) -> ClosedDigit {
        let closing = self.closing(digit, None, obstacles);
        let relaxed = closing.relax(flexion);
        if self.is_clear(&relaxed) {
            return relaxed;
        }
        let others = EVASIVE_FLEXIONS.map(|flexion| closing.relax(flexion));
        let free = others.into_iter().find(|other| self.is_clear(other));
        free.unwrap_or(relaxed)
    }
}

/// Distance, in metres, that a digit stops short of [`SOFT_CONTACT`]: it absorbs the tolerance of the search for a touch.
const OBSTACLE_MARGIN: f32 = 0.001;

/// A part of the hand that a digit does not go through.
#[derive(Clone, Copy, Debug)]
pub struct Obstacle {
    solid: Bounded,
    /// Its index among the parts of [`RestOverlaps`](crate::model::hand::rig::RestOverlaps).
    pub(super) part: usize,
}

impl Obstacle {
    /// A solid of a part of the hand: a link of the thumb, the palm or the ball of the thumb, by its index among the parts of
    /// [`RestOverlaps`](crate::model::hand::rig::RestOverlaps).
    pub fn new(solid: TaperedCapsule, part: usize) -> Self {
        Self {
            solid: Bounded::new(solid),
            part,
        }
    }

    /// The palm, which stops every digit. [`self_clearance`] lists which parts can meet.
    pub fn of_palm(solids: &HandSolids) -> impl Iterator<Item = Self> {
        solids.palm.iter().map(|solid| Self::new(*solid, PALM_PART))
    }

    /// The thumb and its ball, which stop the fingers in addition to the palm.
    pub fn of_thumb(solids: &HandSolids) -> impl Iterator<Item = Self> {
        let [thumb, ..] = &solids.phalanges;
        let links = thumb
            .iter()
            .enumerate()
            .map(|(link, solid)| Self::new(*solid, link));
        links.chain(
            solids
                .thenar
                .iter()
                .map(|solid| Self::new(*solid, THUMB_BALL_PART)),
        )
    }

    /// True if it stops this link of a digit: the first link overlaps palm and ball of the thumb in every pose.
    pub(super) fn stops(&self, link: usize) -> bool {
        link > 0 || self.part < PALM_PART
    }

    /// A lower bound on the gap to a link in metres, plus the allowed overlap; exact below [`COARSE_GAP`] and `enough`.
    pub(super) fn gap(&self, link: &Bounded, rest_overlap: f32, enough: f32) -> f32 {
        let flesh = SOFT_CONTACT - OBSTACLE_MARGIN + rest_overlap;
        let lower_bound = self.solid.distance_lower_bound(link) + flesh;
        if lower_bound > COARSE_GAP.min(enough) {
            return lower_bound;
        }
        self.solid.solid.distance(&link.solid) + flesh
    }
}

/// Total flexions in radians that a digit may make way to: stretched, up to tucked into the palm.
const FLEXIONS: [f32; 8] = [0.0, 0.35, 0.7, 1.15, 1.6, 2.2, 3.0, TUCKED_FLEXION];

/// Yaws that a thumb may make way to, as shares of its range; fingers keep theirs.
const THUMB_YAWS: [f32; 3] = [0.0, 0.5, 1.0];

/// A hand after some of its digits have made way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Evaded {
    /// The hand, in the object's frame.
    pub pose: HandPose,
    /// The digits that were moved, thumb first. They do not touch the object.
    pub moved: [bool; 5],
}

/// Moves the digits that are too close to barriers, each as little as it takes. The others keep their poses. `None` if palm
/// or forearm are too close, or if a digit has nowhere to go.
pub(crate) fn evade(
    scene: &ObjectScene<'_>,
    rig: &Rig,
    pose: &HandPose,
    barriers: Barriers<'_>,
) -> Option<Evaded> {
    let solids = HandSolids::of_pose(rig, pose);
    let tracked = TrackedSolids::of_rig(rig, pose.frame_from_wrist, &solids);
    let nears = |part: &TaperedCapsule| barriers.comes_within(std::iter::once(part), GIVER_CLEARANCE);
    if tracked.still().any(nears) {
        return None;
    }
    let mut evaded = Evaded {
        pose: *pose,
        moved: Digit::ALL.map(|digit| rig.has(digit) && parts_of(digit, &solids).any(nears)),
    };
    let mut obstacles: Vec<Obstacle> = Obstacle::of_palm(&solids).collect();
    for digit in Digit::ALL {
        if evaded.moved[digit.index()] {
            evaded.pose = with_digit_away(scene, rig, &evaded.pose, digit, barriers, &obstacles)?;
        }
        if digit == Digit::Thumb {
            obstacles.extend(Obstacle::of_thumb(&HandSolids::of_pose(rig, &evaded.pose)));
        }
    }
    Some(evaded)
}

/// The solids that move with a digit.
fn parts_of(digit: Digit, solids: &HandSolids) -> impl Iterator<Item = &TaperedCapsule> + Clone {
    let ball: &[TaperedCapsule] = if digit == Digit::Thumb {
        &solids.thenar
    } else {
        &[]
    };
    solids.phalanges[digit.index()].iter().chain(ball)
}

/// The hand with a digit in the nearest pose that is clear of barriers, object and hand.
fn with_digit_away(
    scene: &ObjectScene<'_>,
    rig: &Rig,
    pose: &HandPose,
    digit: Digit,
    barriers: Barriers<'_>,
    obstacles: &[Obstacle],
) -> Option<HandPose> {
    let closer = Closer::of_pose(scene, rig, barriers, &HandShape::ALL_CLOSE, pose);
    let present = pose.digits[digit.index()];
    let AngleRange { min, max } = rig.digit(digit).limits.base_yaw;
    let other_yaws = THUMB_YAWS.map(|share| min + (max - min) * share);
    let other_yaws: &[f32] = if digit == Digit::Thumb { &other_yaws } else { &[] };
    let yaws = std::iter::once(present.base_yaw).chain(other_yaws.iter().copied());
    let mut poses: Vec<(f32, DigitAngles)> = yaws
        .flat_map(|yaw| {
            let closing = closer.closing(digit, Some(yaw), obstacles);
            FLEXIONS.map(|flexion| closing.relax(flexion).angles)
        })
        .map(|angles| (travel(rig, digit, pose, angles), angles))
        .collect();
    poses.sort_by(|a, b| a.0.total_cmp(&b.0));
    poses.into_iter().find_map(|(_, angles)| {
        let mut tried = *pose;
        tried.digits[digit.index()] = angles;
        let solids = HandSolids::of_pose(rig, &tried);
        let surface = &scene.object.surface;
        let is_clear = !barriers.comes_within(parts_of(digit, &solids), GIVER_CLEARANCE)
            && !solids.phalanges[digit.index()]
                .iter()
                .any(|link| comes_within(link, surface, 0.0))
            && self_clearance(rig, &solids) >= 0.0
            && !nears_forbidden_surface(scene, parts_of(digit, &solids));
        is_clear.then_some(tried)
    })
}

/// How far the joints of a digit move together to its pose in another hand with the same wrist, in metres.
fn travel(rig: &Rig, digit: Digit, pose: &HandPose, angles: DigitAngles) -> f32 {
    let joints = |angles: DigitAngles| {
        DigitPlane::new(rig.digit(digit), pose.frame_from_wrist, angles.base_yaw).joints(&angles)
    };
    let (from, to) = (joints(pose.digits[digit.index()]), joints(angles));
    from.iter().zip(&to).map(|(from, to)| from.distance(*to)).sum()
}
