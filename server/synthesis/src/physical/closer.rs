//! Step 2 under `PHYSICAL` validity for all digits of one hand: thumb first, then fingers, then idle fingers come to
//! rest. The thumb of a hook rests first.

use super::{
    barriers::Barriers,
    closing::{ClosedDigit, Closing},
    flexing::Flexing,
    grip::{GIVER_CLEARANCE, nears_forbidden_surface},
    obstacle::Obstacle,
    scene::ObjectScene,
    shape::{HandShape, TUCKED_FLEXION},
    solids::link_radii,
};
use crate::{
    base::{
        pose::Pose,
        rejection::{Failure, Rejection},
        stop::Stop,
    },
    model::hand::{Digit, DigitAngles, HandPose, kinematics::DigitPlane, rig::Rig},
};

/// Flexions in radians, in order of preference, that take an idle finger clear of the barriers: tucked into the palm, or
/// nearly straight.
const EVASIVE_FLEXIONS: [f32; 2] = [TUCKED_FLEXION, 0.6];

/// Total flexion of a relaxed thumb, in radians: a thumb that lies next to the index finger is nearly straight.
const RESTING_THUMB_FLEXION: f32 = 0.35;

/// Closes the digits of a hand whose wrist is fixed.
#[derive(Debug)]
pub(super) struct Closer<'a> {
    /// The object being grasped.
    pub scene: &'a ObjectScene<'a>,
    /// What the hand keeps clear of.
    pub barriers: Barriers<'a>,
    /// The rig of the closing hand.
    pub rig: &'a Rig,
    /// The shape the hand closes from.
    pub shape: &'a HandShape,
    /// Its wrist pose, in the object's frame.
    pub object_from_wrist: Pose,
}

impl Closer<'_> {
    /// The hand pose with these digits.
    pub(super) fn pose(&self, digits: &[ClosedDigit; 5]) -> HandPose {
        HandPose {
            frame_from_wrist: self.object_from_wrist,
            digits: digits.map(|digit| digit.angles),
        }
    }

    fn closing<'a>(&'a self, digit: Digit, obstacles: &'a [Obstacle]) -> Closing<'a> {
        let flexing = self.shape.flexing(self.rig, digit);
        Closing {
            surface: &self.scene.object.surface,
            flexing,
            radii: link_radii(self.rig, digit),
            plane: DigitPlane::new(flexing.digit, self.object_from_wrist, flexing.base_yaw),
            preshape: self.shape.preshape[usize::from(digit != Digit::Thumb)],
            obstacles,
            rest_overlaps: self
                .rig
                .rest_overlaps
                .as_deref()
                .map(|overlaps| overlaps.of_digit(digit)),
            curls_last: self.shape.is_hook() && digit != Digit::Thumb,
        }
    }

    /// The same with another yaw than the shape's.
    fn closing_at<'a>(&'a self, digit: Digit, base_yaw: f32, obstacles: &'a [Obstacle]) -> Closing<'a> {
        let closing = self.closing(digit, obstacles);
        Closing {
            flexing: Flexing {
                base_yaw,
                ..closing.flexing
            },
            plane: DigitPlane::new(closing.flexing.digit, self.object_from_wrist, base_yaw),
            ..closing
        }
    }

    /// A digit that somebody posed, closed or opened as little as it takes to touch. `None` if it cannot be freed.
    pub(super) fn settle(
        &self,
        digit: Digit,
        posed: DigitAngles,
        obstacles: &[Obstacle],
    ) -> Option<ClosedDigit> {
        self.closing_at(digit, posed.base_yaw, obstacles).settle(posed)
    }

    /// A relaxed pose with a given yaw, bent by `flexion` radians in total or less if something stops it.
    pub(super) fn relaxed(
        &self,
        digit: Digit,
        base_yaw: f32,
        flexion: f32,
        obstacles: &[Obstacle],
    ) -> DigitAngles {
        self.closing_at(digit, base_yaw, obstacles).relax(flexion).angles
    }

    /// Closes a digit as far as it goes. `None` if it starts inside something or comes too close to a barrier.
    fn close(&self, digit: Digit, obstacles: &[Obstacle]) -> Option<ClosedDigit> {
        let closed = self.closing(digit, obstacles).close()?;
        self.is_clear(&closed).then_some(closed)
    }

    fn nears_forbidden(&self, digit: &ClosedDigit) -> bool {
        nears_forbidden_surface(self.scene, digit.links.iter())
    }

    /// True if a digit keeps [`GIVER_CLEARANCE`] from the barriers.
    fn is_clear(&self, digit: &ClosedDigit) -> bool {
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
    ///
    /// # Errors
    /// No finger touches the object, or the stop signal came.
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

    /// The digits with what they touch as they are.
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

    /// A relaxed pose for a digit that holds nothing; where that is too close to a barrier, tucked away or nearly
    /// straight.
    fn rest(&self, digit: Digit, obstacles: &[Obstacle], flexion: f32) -> ClosedDigit {
        let closing = self.closing(digit, obstacles);
        let relaxed = closing.relax(flexion);
        if self.is_clear(&relaxed) {
            return relaxed;
        }
        let others = EVASIVE_FLEXIONS.map(|flexion| closing.relax(flexion));
        let free = others.into_iter().find(|other| self.is_clear(other));
        free.unwrap_or(relaxed)
    }
}
