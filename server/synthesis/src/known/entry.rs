//! A grip of the atlas.

use super::{
    finger_subsets::FingerSubsets,
    friction_uses::FrictionUses,
    gravity::{DIRECTIONS, direction},
};
use crate::{
    base::pose::Pose,
    model::{
        constraints::Constraints,
        grasp::{Contact, Grasp},
        grasp_type::Classification,
        hand::rig::Rig,
        score::{Score, Term, Values},
    },
    physical::{
        contacts::soften,
        grip::{Grip, Gripper},
        immobility::{FrictionUse, balance},
        scene::ObjectScene,
        solids::{HandSolids, TrackedSolids},
    },
    rating::{
        scoring::{force_values, grip_values},
        taxonomy::classify,
    },
};

/// The score of a grip that cannot hold the object in a direction.
pub const SLIPS: u8 = 0;

/// A grip with what was found out about it once.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The hand on the object.
    pub grip: Grip,
    /// Where it touches.
    pub contacts: Vec<Contact>,
    /// Its type of the taxonomy.
    pub classification: Classification,
    /// The score's terms that depend on hand and object alone.
    pub grip_values: Values,
    /// For each of [`DIRECTIONS`] against gravity: the score of grip and comfort in 1 … 255, or [`SLIPS`].
    pub scores: [u8; DIRECTIONS],
    /// For each of them, how much friction the forces use; all of it where there are none.
    pub friction_uses: FrictionUses,
    /// Which fingers hold without the others.
    pub finger_subsets: FingerSubsets,
}

impl Entry {
    /// An entry from what a gripper has just closed.
    pub fn new(
        scene: &ObjectScene<'_>,
        rig: &Rig,
        grip: Grip,
        solids: &HandSolids,
        gripper: &mut Gripper,
    ) -> Self {
        let contacts = gripper.contacts.clone();
        let classification = classify(rig, &grip.pose, &contacts);
        let grip_values = grip_values(
            scene,
            rig,
            &grip.pose,
            &contacts,
            classification,
            grip.epsilon,
            solids,
        );
        let of_grip = Score { values: grip_values }.grip_total();
        let mut friction_uses = FrictionUses::default();
        let scores = std::array::from_fn(|index| {
            let load = scene.load(direction(index));
            let held = balance(&gripper.soft_contacts, &load, &mut gripper.buffers);
            friction_uses.set(
                index,
                held.as_ref()
                    .map_or(FrictionUse::Full, |balance| balance.friction_use),
            );
            held.map_or(SLIPS, |balance| {
                let values = force_values(scene, &contacts, &balance.forces);
                quantised(of_grip + Score { values }.total())
            })
        });
        let finger_subsets = FingerSubsets::of(grip.holding_digits(), |kept| {
            let of_kept = contacts.iter().filter(|contact| contact.part.is_palm_or_in(kept));
            soften(of_kept, scene.friction, &mut gripper.soft_contacts);
            gripper.closure(scene).is_some()
        });
        Self {
            grip,
            contacts,
            classification,
            grip_values,
            scores,
            friction_uses,
            finger_subsets,
        }
    }

    /// What a grasp is known as for other holdouts of its object. How it fares under which gravity, and without some of its
    /// fingers, is not known. None if it is not valid under `PHYSICAL`, and only right under the friction that it was found under.
    pub fn of_grasp(grasp: &Grasp) -> Option<Self> {
        let margins = grasp.margins?;
        let Score { mut values } = grasp.score?;
        for (term, value) in Term::ALL.into_iter().zip(&mut values) {
            if !term.is_grip_term() {
                *value = 0.0;
            }
        }
        let grip = Grip {
            pose: grasp.pose,
            bend_ratios: grasp.bend_ratios,
            penetration: margins.penetration,
            epsilon: margins.epsilon,
        };
        Some(Self {
            finger_subsets: FingerSubsets::whole(grip.holding_digits()),
            grip,
            contacts: grasp.contacts.clone(),
            classification: grasp.classification,
            grip_values: values,
            scores: [SLIPS; DIRECTIONS],
            friction_uses: FrictionUses::default(),
        })
    }

    /// What a grip of the same hand and contacts is worth now; none if its closure is not enough.
    pub fn reassessed(&self, scene: &ObjectScene<'_>, rig: &Rig, gripper: &mut Gripper) -> Option<Self> {
        gripper.contacts.clone_from(&self.contacts);
        soften(&self.contacts, scene.friction, &mut gripper.soft_contacts);
        let grip = Grip {
            epsilon: gripper.closure(scene)?,
            ..self.grip.clone()
        };
        let solids = HandSolids::of_pose(rig, &grip.pose);
        Some(Self::new(scene, rig, grip, &solids, gripper))
    }

    /// The same grip moved and turned. Which triangles it touches and what it is worth stays as it was where it was tried.
    #[must_use]
    pub fn moved(&self, way: Pose) -> Self {
        let mut moved = self.clone();
        let wrist = &mut moved.grip.pose.frame_from_wrist;
        *wrist = way * *wrist;
        for contact in &mut moved.contacts {
            contact.position = way.transform_point(contact.position);
            contact.normal = way.transform_vector(contact.normal);
        }
        moved
    }

    /// The hand as solids, in the object's frame. They are not kept, as they would take twice as much memory as the rest.
    pub fn solids(&self, rig: &Rig) -> HandSolids {
        HandSolids::of_pose(rig, &self.grip.pose)
    }

    /// The hand as solids for where it is beside a giver's, in the object's frame.
    pub fn tracked_solids(&self, rig: &Rig) -> TrackedSolids {
        TrackedSolids::of_rig(rig, self.grip.pose.frame_from_wrist, &self.solids(rig))
    }

    /// True if wrist, contacts and type are what is demanded.
    pub fn is_wanted(&self, constraints: &Constraints) -> bool {
        constraints.admits_wrist(self.grip.pose.frame_from_wrist)
            && constraints.admits_contacts(&self.contacts)
            && constraints.admits_type(self.classification.grasp_type)
    }

    /// Bytes that the entry takes.
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val(self.contacts.as_slice())
    }
}

/// A score as a number from 1 to 255.
fn quantised(score: f32) -> u8 {
    (1.0 + score.clamp(0.0, 1.0) * 254.0).round() as u8
}
