//! Posed hands: closed or opened as little as it takes to touch, or unchanged.

use super::{Grip, Gripper, MAX_PENETRATION, collect_contacts, collides_without_digits, soften};
use crate::{
    base::{rejection::Rejection, stopwatch::Stopwatch},
    model::{
        grasp::Contact,
        hand::{Digit, DigitAngles, HandPose, rig::Rig},
    },
    physical::{
        barriers::Barriers,
        closer::{Closer, Obstacle},
        closing::ClosedDigit,
        immobility::{BALANCE_TOLERANCE, Balance, epsilon, nearest_balance},
        presented::{ObjectScene, Presented},
        shape::HandShape,
        solids::{HandSolids, TrackedSolids, clearance, comes_within},
    },
};

/// Fewest contacts that hold anything.
pub const FEWEST_CONTACTS: usize = 2;

/// Treatment of a posed hand's digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PosedDigits {
    /// Every digit bends slightly from its pose, or from a less bent one if that is inside something, up to its first touch. A
    /// digit that touches nothing keeps its pose.
    Settled,
    /// They keep their poses.
    Still,
}

/// Why a posed hand cannot be a grip under any friction and in any holdout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Misfit {
    /// Palm or forearm are this deep in the object, in metres.
    Palm(f32),
    /// A digit is inside the object or another part of the hand, however it bends.
    Digits,
    /// Only this many parts of the hand touch.
    Contacts(usize),
}

impl Gripper {
    /// Makes a grip of a posed hand whose wrist stays where it is; its contacts are in `contacts` afterwards, and how the object
    /// hangs in it in `hang`.
    ///
    /// # Errors
    /// The first check that fails.
    pub fn hold_posed(
        &mut self,
        scene: &ObjectScene<'_>,
        rig: &Rig,
        pose: &HandPose,
        presented: &Presented,
        digits: PosedDigits,
    ) -> Result<(Grip, HandSolids), Rejection> {
        self.posed.clear();
        self.closure_share = 0.0;
        self.hang = None;
        let barriers = presented.barriers();
        let still = HandSolids::of_pose(rig, pose);
        let tracked = TrackedSolids::of_rig(rig, pose.frame_from_wrist, &still);
        if collides_without_digits(scene, barriers, &tracked) {
            return Err(Rejection::PalmCollision);
        }
        let shape = shape_of(pose);
        let closer = Closer::of_pose(scene, rig, barriers, &shape, pose);
        let digits = match digits {
            PosedDigits::Settled => self.settle(&closer, pose),
            PosedDigits::Still => Some(as_posed(scene, rig, pose, &still)),
        };
        let digits = digits.ok_or(Rejection::FingerCollision)?;
        self.touch(&closer, &digits);
        let thumb_touches = digits[Digit::Thumb.index()].touches_object();
        let mut epsilon = self.opposed_closure(scene);
        if epsilon.is_none() && !thumb_touches {
            epsilon = self.hang(scene, &digits, presented.up);
        }
        let epsilon = epsilon.ok_or(Rejection::NotImmobilizing)?;
        self.validate(&closer, &digits, epsilon, &mut Stopwatch::off())
    }

    /// Why a posed hand cannot be a grip of an object; `None` if it may be one.
    pub fn misfit(&mut self, scene: &ObjectScene<'_>, rig: &Rig, pose: &HandPose) -> Option<Misfit> {
        let surface = &scene.object.surface;
        let still = HandSolids::of_pose(rig, pose);
        let deepest = still.palm.iter().chain(&still.forearm);
        let deepest = deepest.fold(0.0, |least: f32, part| least.min(clearance(part, surface, least)));
        if deepest < -MAX_PENETRATION {
            return Some(Misfit::Palm(-deepest));
        }
        let shape = shape_of(pose);
        let closer = Closer::of_pose(scene, rig, Barriers::NONE, &shape, pose);
        let is_inside = still
            .iter()
            .any(|part| comes_within(part, surface, -MAX_PENETRATION));
        let digits = match self.settle(&closer, pose) {
            Some(digits) => digits,
            None if is_inside => return Some(Misfit::Digits),
            None => as_posed(scene, rig, pose, &still),
        };
        self.touch(&closer, &digits);
        let contacts = self.contacts.len();
        (contacts < FEWEST_CONTACTS).then_some(Misfit::Contacts(contacts))
    }

    /// The digits, thumb first; `None` if one cannot be freed.
    fn settle(&mut self, closer: &Closer<'_>, pose: &HandPose) -> Option<[ClosedDigit; 5]> {
        let rig = closer.rig;
        self.obstacles.clear();
        self.obstacles
            .extend(Obstacle::of_palm(&HandSolids::of_pose(rig, pose)));
        let mut digits = [ClosedDigit::default(); 5];
        for digit in Digit::ALL.into_iter().filter(|&digit| rig.has(digit)) {
            let posed = pose.digits[digit.index()];
            let closing = closer.closing(digit, Some(posed.base_yaw), &self.obstacles);
            let settled = closing.settle(posed)?;
            if !closer.is_clear(&settled) {
                return None;
            }
            digits[digit.index()] = settled;
            if digit == Digit::Thumb {
                let with_thumb = HandSolids::of_pose(rig, &closer.pose(&digits));
                self.obstacles.extend(Obstacle::of_thumb(&with_thumb));
            }
        }
        Some(digits)
    }
}

/// The digits in their poses, thumb first; missing ones do not touch.
fn as_posed(scene: &ObjectScene<'_>, rig: &Rig, pose: &HandPose, solids: &HandSolids) -> [ClosedDigit; 5] {
    let mut digits = [ClosedDigit::default(); 5];
    for digit in Digit::ALL.into_iter().filter(|&digit| rig.has(digit)) {
        let place = digit.index();
        digits[place] =
            ClosedDigit::as_posed(pose.digits[place], solids.phalanges[place], &scene.object.surface);
    }
    digits
}

/// The shape of the hand that its grip keeps: the bend ratios.
pub(super) fn shape_of(pose: &HandPose) -> HandShape {
    let ratio = |digit: Digit| {
        let DigitAngles {
            base_pitch,
            second_pitch,
            ..
        } = pose.digits[digit.index()];
        if base_pitch > 0.0 && second_pitch > 0.0 {
            second_pitch / base_pitch
        } else {
            1.0
        }
    };
    HandShape {
        bend_ratios: [Digit::Thumb, Digit::Index].map(ratio),
        ..HandShape::ALL_CLOSE
    }
}

/// How a hand holds an object.
#[derive(Clone, Debug)]
pub struct PosedHold {
    /// Which digits touch, thumb first.
    pub touching: [bool; 5],
    /// Ferrari-Canny epsilon of the contacts.
    pub epsilon: f32,
    /// The required epsilon; `None` if the object hangs in the fingers.
    pub required: Option<f32>,
    /// True if the contacts have closure, or if the object hangs in the fingers.
    pub is_enclosed: bool,
    /// The epsilon, or the height of the way out for a hanging object, as a multiple of the required value.
    pub relative_closure: f32,
    /// Forces that balance the weight, or nearly do.
    pub balance: Balance,
}

impl PosedHold {
    /// True if the contacts hold the object as it is presented.
    fn holds(&self) -> bool {
        self.is_enclosed && self.balance.residual <= BALANCE_TOLERANCE
    }

    /// True if the object hangs in the fingers.
    pub fn hangs(&self) -> bool {
        self.required.is_none()
    }
}

impl Gripper {
    /// How a posed hand holds the object, regardless of collisions; its contacts are in `contacts` afterwards. A load hangs only in
    /// fingers without the thumb, as in the grips of a search, and only if contacts and forces allow it.
    pub fn hold_as_posed(
        &mut self,
        scene: &ObjectScene<'_>,
        rig: &Rig,
        pose: &HandPose,
        presented: &Presented,
        may_hang: impl Fn(&[Contact], &Balance) -> bool,
    ) -> PosedHold {
        let solids = HandSolids::of_pose(rig, pose);
        let digits = as_posed(scene, rig, pose, &solids);
        collect_contacts(scene.object, rig, pose, &digits, &mut self.contacts);
        soften(&self.contacts, scene.friction, &mut self.soft_contacts);
        let touching = digits.map(|digit| digit.touches_object());
        let hanging = if touching[Digit::Thumb.index()] {
            None
        } else {
            self.hanging(scene, &digits, presented)
        };
        if let Some(hanging) = &hanging
            && hanging.holds()
            && may_hang(&self.contacts, &hanging.balance)
        {
            return hanging.clone();
        }
        let alone = self.alone(scene, touching, presented);
        // If neither holds, report the hold that the hand is shaped for.
        hanging.filter(|_| !alone.holds()).unwrap_or(alone)
    }

    /// By closure.
    fn alone(&mut self, scene: &ObjectScene<'_>, touching: [bool; 5], presented: &Presented) -> PosedHold {
        self.hang = None;
        let load = scene.load(&self.soft_contacts, presented.up);
        let required = scene.required_epsilon(&load.torque_scale);
        let closure = self.opposed_closure(scene);
        // For a rejected hand, this is only some number below the required epsilon.
        let exact = closure.unwrap_or_else(|| epsilon(&self.soft_contacts, &load, 0.0, &mut self.buffers));
        PosedHold {
            touching,
            epsilon: exact,
            required: Some(required),
            is_enclosed: closure.is_some(),
            relative_closure: self.relative_closure(scene, exact),
            balance: nearest_balance(&self.soft_contacts, &load, &mut self.buffers),
        }
    }

    /// By hanging.
    fn hanging(
        &mut self,
        scene: &ObjectScene<'_>,
        digits: &[ClosedDigit; 5],
        presented: &Presented,
    ) -> Option<PosedHold> {
        let epsilon = self.hang(scene, digits, presented.up)?;
        let hang = self.hang?;
        let load = hang.load_at_rest(scene.load(&self.soft_contacts, presented.up));
        Some(PosedHold {
            touching: digits.map(|digit| digit.touches_object()),
            epsilon,
            required: None,
            is_enclosed: true,
            relative_closure: hang.relative_lip(),
            balance: nearest_balance(&self.soft_contacts, &load, &mut self.buffers),
        })
    }
}
