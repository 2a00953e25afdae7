//! What depends on the contacts of a posed hand.

use super::{Measure, Reading};
use crate::{
    model::{
        grasp::{Contact, Grasp},
        grasp_type::{Classification, GraspType},
        holdout::ArmPose,
    },
    physical::{
        barriers::BarrierClearances,
        grip::{FEWEST_CONTACTS, Grip, Gripper, PosedHold},
        immobility::{BALANCE_TOLERANCE, Balance},
    },
    rating::{
        assessment::{GraspContext, unscored_grasp},
        comfort::{comfort, digit_totals},
    },
};

/// A posed hand with its contacts.
pub(in crate::search) struct Held<'a> {
    pub(in crate::search) hold: PosedHold,
    pub(in crate::search) contacts: &'a [Contact],
    reading: &'a Reading<'a>,
}

impl Reading<'_> {
    /// How the hand holds the object, whatever it collides with. Something hangs in it only if the requirements admit that.
    pub(in crate::search) fn held<'b>(&'b self, gripper: &'b mut Gripper) -> Held<'b> {
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
    pub(in crate::search) fn contacts(&self) -> Measure {
        let count = self.contacts.len();
        Measure {
            figure: count as f32,
            bound: FEWEST_CONTACTS as f32,
            passed: count >= FEWEST_CONTACTS,
        }
    }

    /// True if the requirements admit the digits that touch.
    pub(in crate::search) fn are_digits_admitted(&self) -> bool {
        self.reading.around.requirements.admits_contacts(self.contacts)
    }

    /// The unbalanced share of the weight.
    pub(in crate::search) fn balance(&self) -> Measure {
        let residual = self.hold.balance.residual;
        Measure {
            figure: residual,
            bound: BALANCE_TOLERANCE,
            passed: residual <= BALANCE_TOLERANCE,
        }
    }

    /// The type of the hand.
    pub(in crate::search) fn classification(&self) -> Classification {
        let Reading { around, pose, .. } = self.reading;
        around.classification(pose, self.contacts, self.hold.hangs())
    }

    /// True if the requirements admit a type.
    pub(in crate::search) fn is_type_admitted(&self, classification: Classification) -> bool {
        let requirements = self.reading.around.requirements;
        requirements.admits_type(classification.grasp_type)
    }

    /// True if the requirements admit the comfort of the forces.
    pub(in crate::search) fn is_comfort_admitted(&self) -> bool {
        let comfort = comfort_of(self.contacts, &self.hold.balance);
        self.reading.around.requirements.admits_comfort(comfort)
    }

    /// The hand as a grasp of this type, without a score.
    pub(in crate::search) fn grasp(
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
    pub(in crate::search) fn scored(&self, grasp: Grasp) -> Grasp {
        let Reading { around, solids, .. } = self.reading;
        around.scored(grasp, self.hold.relative_closure, solids)
    }
}

fn comfort_of(contacts: &[Contact], balance: &Balance) -> f32 {
    comfort(digit_totals(contacts, &balance.forces))
}
