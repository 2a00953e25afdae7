//! Hands that are judged exactly as they are: neither closed nor moved.

use super::{Grip, Gripper, NoGrip, are_opposed, collect_contacts, posed_hand::shape_of, soften};
use crate::{
    base::{rejection::Rejection, stopwatch::NoStopwatch},
    model::hand::{Digit, HandPose, rig::Rig},
    physical::{
        closer::Closer,
        closing::{ClosedDigit, TOUCHING},
        scene::{ObjectScene, Presented},
        solids::{HandSolids, TaperedCapsule, clearance},
    },
};

/// How a given hand is to hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HoldsBy {
    /// The object hangs in it if the thumb does not touch and it can; otherwise its contacts need closure.
    HookOrClosure,
    /// Its contacts need closure.
    Closure,
}

impl Gripper {
    /// Makes a grip of a hand as it is given; its contacts are in `contacts` afterwards. A link touches where a closing one
    /// would have stopped.
    ///
    /// # Errors
    /// The first check that fails.
    pub fn hold_given(
        &mut self,
        scene: &ObjectScene<'_>,
        rig: &Rig,
        pose: &HandPose,
        presented: &Presented,
        by: HoldsBy,
    ) -> Result<(Grip, HandSolids), NoGrip> {
        self.posed.clear();
        self.closure_share = 0.0;
        self.hang = None;
        let solids = HandSolids::of_pose(rig, pose);
        let touches = |link: &TaperedCapsule| clearance(link, &scene.object.surface, TOUCHING) < TOUCHING;
        let digits = Digit::ALL.map(|digit| {
            if !rig.has(digit) {
                return ClosedDigit::default();
            }
            let links = solids.phalanges[digit.index()];
            ClosedDigit {
                angles: pose.digits[digit.index()],
                touches: links.each_ref().map(touches),
                links,
            }
        });
        collect_contacts(scene.object, rig, pose, &digits, &mut self.contacts);
        soften(&self.contacts, scene.friction, &mut self.soft_contacts);
        let may_hang = by == HoldsBy::HookOrClosure && !digits[Digit::Thumb.index()].touches_object();
        let hanging = may_hang
            .then(|| self.hang(scene, &digits, presented.up))
            .flatten();
        let epsilon = hanging.or_else(|| are_opposed(&self.contacts).then(|| self.closure(scene)).flatten());
        let epsilon = epsilon.ok_or(NoGrip::Rejected(Rejection::NotImmobilizing))?;
        let closer = Closer {
            scene,
            barriers: presented.barriers(),
            rig,
            shape: &shape_of(pose),
            object_from_wrist: pose.frame_from_wrist,
        };
        self.validate(&closer, &digits, epsilon, &mut NoStopwatch)
    }
}
