//! Random holdouts: recorded hands, placed on an object as givers, under gravity from any direction.
//!
//! Placing a hand takes a fifth of a second, so there are some dozens of placements per object ([`place`]). A holdout
//! draws one of these givers and a rotation in the client's frame ([`Givers::draw`]). Everything follows from the seed.

use std::{collections::HashMap, path::Path, sync::Arc};

use glam::Vec3;
use grasp_assets::{
    hands::hand,
    holdouts::{BuiltInHoldout, holdouts},
};
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::{
        hand::{
            HandPose, Handedness,
            joints::{HandJoints, index},
        },
        holdout::{Holdout, PresentingHand, Stance},
        object::GraspObject,
    },
};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::{
    giver::{place_giver, random_rotation},
    recorded::{data_folder, read_poses},
    wire_pose,
};

/// Recorded poses in which a hand can hold something; the quality judge uses the same ones.
const HOLDING: [&str; 18] = [
    "Cup",
    "Grip",
    "Grip 1",
    "Grip 2",
    "Grip 3",
    "Grip 4",
    "Grip 5",
    "Grip Shaft",
    "Hold",
    "OK",
    "Pinch Flat",
    "Pinch Large",
    "Pinch Middle",
    "Pinch Tight",
    "Pinch Up",
    "PingPong",
    "Rounded",
    "relax",
];

/// Files of recorded poses.
const POSE_FILES: [&str; 2] = ["godot_xr_tools_poses.json", "handy-work_poses.json"];

/// How deep a giver's skin may be in the object, in metres, as flesh gives way. Deeper ones are placed again.
const GIVER_DEPTH: f32 = 0.004;

/// Digits that must touch: fewer hold nothing.
const TOUCHING_DIGITS: usize = 2;

/// Placements tried until a hand holds well; then the shallowest counts.
const PLACEMENTS: u64 = 6;

/// Position of the object in the client's frame, in metres. It is off the origin, so that confusing the two frames
/// shows.
const CLIENT_POSITION: Vec3 = Vec3::new(0.0, 1.2, 0.3);

/// A hand that can hold something.
#[derive(Clone, Debug)]
pub struct GivingHand {
    /// Its name, unique among [`giving_hands`].
    pub name: String,
    /// Its joints, in the wrist's `OpenXR` frame.
    pub joints: HandJoints,
}

/// Recorded hands in holding poses; without the recorded data, the givers of the built-in holdouts.
pub fn giving_hands() -> Vec<GivingHand> {
    data_folder().map_or_else(built_in_hands, |folder| recorded_hands(&folder))
}

fn recorded_hands(folder: &Path) -> Vec<GivingHand> {
    let adult = &hand("adult", Handedness::Right)
        .expect("the adult rig is built in")
        .rig;
    let files = POSE_FILES.map(|file| read_poses(&folder.join("poses").join(file), &adult.joint_radii));
    let holding = files
        .into_iter()
        .flatten()
        .filter(|pose| HOLDING.contains(&pose.name.as_str()));
    holding
        .map(|mut pose| {
            // The files have no radii: an adult's, scaled by the length of the middle finger.
            let finger = &pose.joints.joints[index::FIRST_OF_DIGIT[2] + 1..=index::TIP_OF_DIGIT[2]];
            let length: f32 = finger
                .windows(2)
                .map(|pair| pair[0].pose.position.distance(pair[1].pose.position))
                .sum();
            let scale = length / adult.digits[2].lengths.iter().sum::<f32>();
            for joint in &mut pose.joints.joints {
                joint.radius *= scale;
            }
            GivingHand {
                name: format!("{} {:?}", pose.name, pose.joints.handedness),
                joints: pose.joints,
            }
        })
        .collect()
}

fn built_in_hands() -> Vec<GivingHand> {
    let of_holdout = |holdout: &BuiltInHoldout| {
        let rig = &hand(&holdout.giver_rig, holdout.giver_handedness)
            .expect("the rigs of built-in holdouts are built in")
            .rig;
        let joints = HandJoints::of_pose(rig, &holdout.giver_pose());
        let wrist_from_world = joints.joints[index::WRIST].pose.inverse();
        GivingHand {
            name: holdout.name.clone(),
            joints: joints.transformed(wrist_from_world),
        }
    };
    holdouts().iter().map(of_holdout).collect()
}

/// One of [`giving_hands`] on an object.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedGiver {
    /// The hand's name.
    pub hand: String,
    /// The wrist's `OpenXR` frame in the object's frame.
    pub object_from_wrist: Pose,
}

/// Places one of `hands`, which must not be empty, on an object. Takes a fifth of a second; equal for equal arguments.
pub fn place(object: &GraspObject, hands: &[GivingHand], seed: u64) -> PlacedGiver {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let hand = &hands[random.random_range(0..hands.len())];
    let mut shallowest = None;
    for _ in 0..PLACEMENTS {
        let placed = place_giver(object, &hand.joints, random.random());
        if placed.penetration <= GIVER_DEPTH && placed.touching_digits >= TOUCHING_DIGITS {
            shallowest = Some(placed);
            break;
        }
        if shallowest.is_none_or(|other| placed.penetration < other.penetration) {
            shallowest = Some(placed);
        }
    }
    PlacedGiver {
        hand: hand.name.clone(),
        object_from_wrist: shallowest.expect("at least one is placed").object_from_wrist,
    }
}

/// The givers of an object, to draw holdouts from.
#[derive(Clone, Debug)]
pub struct Givers {
    /// Their joints in the object's frame.
    joints: Vec<HandJoints>,
}

impl Givers {
    /// The placed givers; `None` if there are none, or if a giver's hand is not among `hands`.
    pub fn new(hands: &[GivingHand], placed: &[PlacedGiver]) -> Option<Self> {
        let by_name: HashMap<_, _> = hands.iter().map(|hand| (&hand.name, &hand.joints)).collect();
        let joints = placed
            .iter()
            .map(|giver| Some(by_name.get(&giver.hand)?.transformed(giver.object_from_wrist)))
            .collect::<Option<Vec<_>>>()?;
        (!joints.is_empty()).then_some(Self { joints })
    }

    /// A random giver with the object, in a random rotation.
    pub fn draw(&self, random: &mut Xoshiro256PlusPlus) -> ClientHoldout {
        let giver = &self.joints[random.random_range(0..self.joints.len())];
        let client_from_object = Pose::new(CLIENT_POSITION, random_rotation(random).normalize());
        ClientHoldout {
            client_from_object,
            giver: giver.transformed(client_from_object),
        }
    }
}

/// A holdout in a client's frame, +Y up.
#[derive(Clone, Debug)]
pub struct ClientHoldout {
    /// The object in the client's frame.
    pub client_from_object: Pose,
    /// The giver's hand in the client's frame.
    pub giver: HandJoints,
}

impl ClientHoldout {
    /// A built-in holdout in its world.
    pub fn of_built_in(holdout: &BuiltInHoldout) -> Self {
        let rig = &hand(&holdout.giver_rig, holdout.giver_handedness)
            .expect("the rigs of built-in holdouts are built in")
            .rig;
        let giver: HandPose = holdout.giver_pose();
        Self {
            client_from_object: holdout.world_from_object,
            giver: HandJoints::of_pose(rig, &giver),
        }
    }

    /// The holdout in the object's frame, for searches under `PHYSICAL` validity.
    pub fn holdout(&self, object: Arc<GraspObject>) -> Holdout {
        let object_from_client = self.client_from_object.inverse();
        Holdout {
            object,
            presenting_hand: Some(PresentingHand::of_joints(
                self.giver.transformed(object_from_client),
            )),
            other_hands: Vec::new(),
            obstacles: Vec::new(),
            stance: Stance::default(),
            up: object_from_client.transform_vector(Vec3::Y),
        }
    }

    /// A request for a grasp of `object` ("objects/…") with the server's defaults.
    pub fn request(&self, object: &str) -> v1::FindGraspRequest {
        let handedness = match self.giver.handedness {
            Handedness::Left => v1::Handedness::Left,
            Handedness::Right => v1::Handedness::Right,
        };
        let joints = self.giver.joints.iter();
        let joints: Vec<_> = joints
            .map(|joint| v1::JointPose::new(wire_pose(joint.pose), joint.radius))
            .collect();
        v1::FindGraspRequest::new(object)
            .with_client_from_object(wire_pose(self.client_from_object))
            .with_presenting_hand(v1::HandJoints::new(handedness, joints))
    }
}
