//! Hands that somebody posed, taken as they are: what touches, and how it holds.

use super::{Gripper, collect_contacts, soften};
use crate::{
    model::{
        grasp::Contact,
        hand::{Digit, HandPose, rig::Rig},
    },
    physical::{
        closing::ClosedDigit,
        immobility::{BALANCE_TOLERANCE, Balance, epsilon, nearest_balance},
        scene::{ObjectScene, Presented},
        solids::HandSolids,
    },
};

/// How a hand holds an object.
#[derive(Clone, Debug)]
pub struct PosedHold {
    /// Which digits touch, thumb first.
    pub touching: [bool; 5],
    /// Ferrari-Canny epsilon of the contacts.
    pub epsilon: f32,
    /// The least that is required of it; `None` if the object hangs in the fingers.
    pub required: Option<f32>,
    /// True if the contacts have closure, or if the object hangs in the fingers.
    pub is_enclosed: bool,
    /// The epsilon as a multiple of the required one; of what hangs, the height of the way out.
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
    /// How a posed hand holds the object, whatever it collides with; its contacts are in `contacts` afterwards. A load hangs in
    /// fingers only without the thumb, as in grips that search finds, and if its contacts and their forces are such that it may.
    pub fn hold_as_posed(
        &mut self,
        scene: &ObjectScene<'_>,
        rig: &Rig,
        pose: &HandPose,
        presented: &Presented,
        may_hang: impl Fn(&[Contact], &Balance) -> bool,
    ) -> PosedHold {
        let solids = HandSolids::of_pose(rig, pose);
        let mut digits = [ClosedDigit::default(); 5];
        for digit in Digit::ALL {
            let (angles, links) = (pose.digits[digit.index()], solids.phalanges[digit.index()]);
            digits[digit.index()] = if rig.has(digit) {
                ClosedDigit::as_posed(angles, links, &scene.object.surface)
            } else {
                ClosedDigit {
                    angles,
                    links,
                    touches: [false; 3],
                }
            };
        }
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
        // If neither holds, the way of holding that the hand has the shape for is more telling.
        hanging.filter(|_| !alone.holds()).unwrap_or(alone)
    }

    /// By closure.
    fn alone(&mut self, scene: &ObjectScene<'_>, touching: [bool; 5], presented: &Presented) -> PosedHold {
        self.hang = None;
        let load = scene.load(&self.soft_contacts, presented.up);
        let required = scene.required_epsilon(&load.torque_scale);
        let closure = self.opposed_closure(scene);
        // A rejected hand's figure is only some number below the required one.
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
