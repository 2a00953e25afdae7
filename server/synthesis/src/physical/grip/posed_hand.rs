//! Hands that somebody posed, closed or opened as little as it takes to touch.

use super::{GIVER_CLEARANCE, Grip, Gripper, NoGrip, collect_contacts, collides_without_digits, soften};
use crate::{
    base::{rejection::Rejection, stopwatch::NoStopwatch},
    model::hand::{Digit, DigitAngles, HandPose, rig::Rig},
    physical::{
        closer::Closer,
        closing::ClosedDigit,
        obstacle::Obstacle,
        scene::{ObjectScene, Presented},
        shape::HandShape,
        solids::{HandSolids, TrackedSolids},
    },
};

impl Gripper {
    /// Makes a grip of a posed hand whose wrist stays where it is; its contacts are in `contacts` afterwards. Every digit stops at
    /// the first touch on the way from its pose, or less bent if that is inside something, to a slightly more bent one; one that
    /// touches nothing keeps its pose.
    ///
    /// # Errors
    /// The first check that fails.
    pub fn hold_posed(
        &mut self,
        scene: &ObjectScene<'_>,
        rig: &Rig,
        pose: &HandPose,
        presented: &Presented,
    ) -> Result<(Grip, HandSolids), NoGrip> {
        self.posed.clear();
        self.closure_share = 0.0;
        self.hang = None;
        let barriers = presented.barriers();
        let still = HandSolids::of_pose(rig, pose);
        let tracked = TrackedSolids::of_rig(rig, pose.frame_from_wrist, &still);
        if collides_without_digits(scene, barriers, &tracked) {
            return Err(NoGrip::Rejected(Rejection::PalmCollision));
        }
        let shape = shape_of(pose);
        let closer = Closer {
            scene,
            barriers,
            rig,
            shape: &shape,
            object_from_wrist: pose.frame_from_wrist,
        };
        let digits = self
            .settle(&closer, pose)
            .ok_or(NoGrip::Rejected(Rejection::FingerCollision))?;
        collect_contacts(
            scene.object,
            rig,
            &closer.pose(&digits),
            &digits,
            &mut self.contacts,
        );
        soften(&self.contacts, scene.friction, &mut self.soft_contacts);
        let epsilon = self.opposed_closure(scene);
        let epsilon = epsilon.ok_or(NoGrip::Rejected(Rejection::NotImmobilizing))?;
        self.validate(&closer, &digits, epsilon, &mut NoStopwatch)
    }

    /// The digits, thumb first; none if one cannot be freed.
    fn settle(&mut self, closer: &Closer<'_>, pose: &HandPose) -> Option<[ClosedDigit; 5]> {
        let Closer { rig, barriers, .. } = closer;
        self.obstacles.clear();
        self.obstacles
            .extend(Obstacle::of_palm(&HandSolids::of_pose(rig, pose)));
        let mut digits = [ClosedDigit::default(); 5];
        for digit in Digit::ALL.into_iter().filter(|&digit| rig.has(digit)) {
            let settled = closer.settle(digit, pose.digits[digit.index()], &self.obstacles)?;
            if barriers.comes_within(settled.links.iter(), GIVER_CLEARANCE) {
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

/// The shape of the hand, as far as its grip keeps one: how much the second joints bend per degree of the first.
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
        thumb_yaw: 0.5,
        spread: 0.5,
        bend_ratios: [Digit::Thumb, Digit::Index].map(ratio),
        closing: [true; 5],
        preshape: [0.0; 2],
        tucks: false,
    }
}
