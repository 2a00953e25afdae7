//! A known grip of an atlas, and the directions of gravity that its scores are for.

use std::sync::LazyLock;

use glam::Vec3;

use super::{finger_subsets::FingerSubsets, moved_grips::way_with_contacts};
use crate::{
    base::pose::Pose,
    model::{
        grasp::{Contact, Grasp},
        grasp_type::Classification,
        hand::rig::Rig,
        requirements::Requirements,
        score::{Term, Values, grip_total, mean_value},
    },
    physical::{
        contacts::soften,
        grip::{Grip, Gripper},
        immobility::{FrictionUse, balance},
        presented::ObjectScene,
        solids::{HandSolids, TrackedSolids},
    },
    rating::{
        scoring::{force_values, grip_values, sum, upright_values},
        taxonomy::classify,
    },
};

/// The score of a grip that lets the object slip.
pub const SLIPS: u8 = 0;

/// A grip with everything that depends on hand and object alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The hand on the object.
    pub grip: Grip,
    /// Contacts of the hand.
    pub contacts: Vec<Contact>,
    /// Its grasp type in the taxonomy.
    pub classification: Classification,
    /// The terms of the score that depend on hand and object alone.
    pub grip_values: Values,
    /// For each of [`DIRECTIONS`] against gravity: the score of grip and comfort from 1 to 255, or [`SLIPS`].
    pub scores: [u8; DIRECTIONS],
    /// For each of them, how much friction the forces use; full where the object slips.
    pub friction_uses: FrictionUses,
    /// The finger subsets that hold by themselves.
    pub finger_subsets: FingerSubsets,
}

impl Entry {
    /// Evaluates the grip that `gripper` has just closed.
    pub fn new(
        scene: &ObjectScene<'_>,
        rig: &Rig,
        grip: Grip,
        solids: &HandSolids,
        gripper: &mut Gripper,
    ) -> Self {
        let held = Self::of_held(scene, rig, grip, solids, gripper);
        let (grip, contacts) = (&held.grip, &held.contacts);
        let of_grip = grip_total(&held.grip_values);
        let mut friction_uses = FrictionUses::default();
        let scores = std::array::from_fn(|index| {
            let load = scene.load(&gripper.soft_contacts, direction(index));
            let held = balance(&gripper.soft_contacts, &load, &mut gripper.buffers);
            friction_uses.set(
                index,
                held.as_ref()
                    .map_or(FrictionUse::Full, |balance| balance.friction_use),
            );
            held.map_or(SLIPS, |balance| {
                let values = sum(
                    force_values(scene, contacts, &balance.forces),
                    upright_values(scene.object, grip.pose.frame_from_wrist, direction(index)),
                );
                // 0 to 1 as a number from 1 to 255.
                let score = (of_grip + mean_value(&values)).clamp(0.0, 1.0);
                (1.0 + score * 254.0).round() as u8
            })
        });
        let finger_subsets = FingerSubsets::of(grip.holding_digits(), |kept| {
            let kept_contacts = contacts.iter().filter(|contact| contact.part.is_palm_or_in(kept));
            soften(kept_contacts, scene.friction, &mut gripper.soft_contacts);
            gripper.closure(scene).is_some()
        });
        Self {
            scores,
            friction_uses,
            finger_subsets,
            ..held
        }
    }

    /// The grip that `gripper` has just closed, as far as hand and object alone tell. Its scores by gravity and its finger
    /// subsets are unknown.
    pub fn of_held(
        scene: &ObjectScene<'_>,
        rig: &Rig,
        grip: Grip,
        solids: &HandSolids,
        gripper: &Gripper,
    ) -> Self {
        let contacts = gripper.contacts.clone();
        let classification = classify(rig, &grip.pose, &contacts, &scene.object.local_shape);
        let grip_values = grip_values(
            scene,
            rig,
            &grip.pose,
            &contacts,
            classification,
            gripper.relative_closure(scene, grip.epsilon),
            solids,
        );
        Self::ungraded(grip, contacts, classification, grip_values)
    }

    fn ungraded(
        grip: Grip,
        contacts: Vec<Contact>,
        classification: Classification,
        grip_values: Values,
    ) -> Self {
        Self {
            finger_subsets: FingerSubsets::whole(grip.holding_digits()),
            grip,
            contacts,
            classification,
            grip_values,
            scores: [SLIPS; DIRECTIONS],
            friction_uses: FrictionUses::default(),
        }
    }

    /// A grasp as a known grip for other holdouts of its object, under the friction that it was found with. Its scores by gravity
    /// and its finger subsets are unknown. `None` if the grasp is not valid under `PHYSICAL`, takes two hands, or is a hook, from
    /// which the object drops when held out differently.
    pub fn of_grasp(grasp: &Grasp) -> Option<Self> {
        if grasp.other_hand.is_some() || grasp.hangs {
            return None;
        }
        let margins = grasp.margins?;
        let mut grip_values = grasp.score?.values;
        for (term, value) in Term::ALL.into_iter().zip(&mut grip_values) {
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
        let contacts = grasp.contacts.clone();
        Some(Self::ungraded(grip, contacts, grasp.classification, grip_values))
    }

    /// The entry evaluated again from the same hand and contacts; `None` if its closure is insufficient.
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

    /// The same grip displaced. Triangles and scores stay as they were at the original place.
    #[must_use]
    pub fn moved(&self, displacement: Pose) -> Self {
        let mut moved = self.clone();
        let wrist = &mut moved.grip.pose.frame_from_wrist;
        *wrist = displacement * *wrist;
        for contact in &mut moved.contacts {
            contact.position = displacement.transform_point(contact.position);
            contact.normal = displacement.transform_vector(contact.normal);
        }
        moved
    }

    /// The grip on its object at another size, `scale` times the original: contacts stay where they are on the surface, and the
    /// hand, still closed as before, moves with those of the palm or, without any, of all digits. Scores stay as they were.
    #[must_use]
    pub fn on_resized(&self, scale: f32) -> Self {
        let mut resized = self.clone();
        let wrist = &mut resized.grip.pose.frame_from_wrist;
        *wrist = way_with_contacts(&self.contacts, scale) * *wrist;
        for contact in &mut resized.contacts {
            contact.position *= scale;
        }
        resized
    }

    /// The solids of the hand in the object's frame. Storing them would triple the size of an entry.
    pub fn solids(&self, rig: &Rig) -> HandSolids {
        HandSolids::of_pose(rig, &self.grip.pose)
    }

    /// The solids of the hand as they are compared with a giver's, in the object's frame.
    pub fn tracked_solids(&self, rig: &Rig) -> TrackedSolids {
        TrackedSolids::of_rig(rig, self.grip.pose.frame_from_wrist, &self.solids(rig))
    }

    /// Direction of the forearm, straight behind the wrist, from wrist to elbow: a unit vector in the object's frame.
    pub fn forearm(&self) -> Vec3 {
        self.grip.pose.frame_from_wrist.transform_vector(Vec3::NEG_Y)
    }

    /// True if wrist, contacts and grasp type satisfy the requirements.
    pub fn meets(&self, requirements: &Requirements) -> bool {
        requirements.admits_wrist(self.grip.pose.frame_from_wrist)
            && requirements.admits_contacts(&self.contacts)
            && requirements.admits_type(self.classification.grasp_type)
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val(self.contacts.as_slice())
    }
}

/// Number of directions that gravity is quantized to, about 18° apart. More order the grips more exactly, and cost 2 bytes and
/// one balance computation per grip each.
pub const DIRECTIONS: usize = 64;

/// A direction: a point of a Fibonacci lattice on the sphere (R. Swinbank and R. J. Purser, "Fibonacci grids", 2006).
pub fn direction(index: usize) -> Vec3 {
    let golden_angle = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    let z = 1.0 - (2 * index + 1) as f32 / DIRECTIONS as f32;
    let (sin, cos) = (golden_angle * index as f32).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    Vec3::new(radius * cos, radius * sin, z)
}

/// All directions, by coordinate. Computing their sines would take as long as trying a grip.
static COORDINATES: LazyLock<[[f32; DIRECTIONS]; 3]> =
    LazyLock::new(|| std::array::from_fn(|axis| std::array::from_fn(|index| direction(index)[axis])));

/// The index of the direction nearest to a unit vector.
pub fn nearest_direction(up: Vec3) -> usize {
    let [xs, ys, zs] = &*COORDINATES;
    let mut cosines = [0.0; DIRECTIONS];
    for i in 0..DIRECTIONS {
        cosines[i] = xs[i] * up.x + ys[i] * up.y + zs[i] * up.z;
    }
    let highest = cosines.iter().fold(f32::MIN, |a, &b| if b > a { b } else { a });
    cosines.iter().position(|&cosine| cosine == highest).unwrap_or(0)
}

/// The axis nearest to a direction: 0 to 5 for x, -x, y, -y, z, -z.
pub(crate) fn nearest_axis(direction: Vec3) -> u8 {
    let axis = direction.abs().max_position();
    2 * axis as u8 + u8::from(direction[axis] < 0.0)
}

// One bit per direction.
const _: () = assert!(DIRECTIONS == 64);

/// The friction use for each of [`DIRECTIONS`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrictionUses {
    more: u64,
    all: u64,
}

impl FrictionUses {
    /// From bits: directions with more than sparing use, and those with full use.
    pub(super) fn from_bits([more, all]: [u64; 2]) -> Option<Self> {
        (all & !more == 0).then_some(Self { more, all })
    }

    pub(super) fn to_bits(self) -> [u64; 2] {
        [self.more, self.all]
    }

    /// The friction use for a direction.
    pub fn get(self, direction: usize) -> FrictionUse {
        match (self.more >> direction & 1, self.all >> direction & 1) {
            (0, _) => FrictionUse::Low,
            (_, 0) => FrictionUse::Moderate,
            _ => FrictionUse::Full,
        }
    }

    /// Sets the friction use for a direction.
    pub fn set(&mut self, direction: usize, friction_use: FrictionUse) {
        let bit = 1_u64 << direction;
        let put = |bits: u64, is_set: bool| if is_set { bits | bit } else { bits & !bit };
        self.more = put(self.more, friction_use != FrictionUse::Low);
        self.all = put(self.all, friction_use == FrictionUse::Full);
    }
}
