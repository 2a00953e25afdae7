//! Random holdouts: recorded hands, placed on an object as givers, under gravity from any direction.
//!
//! A hand is placed by a seeded random search, then a pattern search over the wrist's pose. It is a set of solids, palm, wrist and forearm
//! included. The cost favours digits and palm that touch the surface without sinking in; the hand starts near one end of the object,
//! which leaves the other to a receiver.
//!
//! Placing a hand takes a fifth of a second, so there are some dozens of placements per object ([`place`]). A holdout
//! draws one of these givers and a rotation in the client's frame ([`Givers::draw`]). Everything follows from the seed.

use std::{collections::HashMap, path::Path};

use glam::{Quat, Vec3};
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
        object::GraspObject,
    },
    physical::solids::{HandSolids, TaperedCapsule, clearance},
};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::{
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

/// A hand on an object.
#[derive(Clone, Copy, Debug)]
pub struct GiverPlacement {
    /// The wrist's `OpenXR` frame in the object's frame.
    pub object_from_wrist: Pose,
    /// Greatest depth of hand or forearm in the object, in metres.
    pub penetration: f32,
    /// How many digits come within 4 mm of the surface.
    pub touching_digits: usize,
}

/// Skin closer to the surface than this counts as touching, in metres.
const TOUCH: f32 = 0.004;

/// Gaps are cut off here, in metres: half a hand away.
const FAR: f32 = 0.05;

/// The part of the hand that a solid belongs to.
#[derive(Clone, Copy)]
enum Owner {
    /// 0 to 4.
    Digit(usize),
    /// The palm with the ball of the thumb.
    Palm,
    /// The forearm, which does not hold.
    Forearm,
}

/// All solids of a hand, in the frame of its joints.
fn parts(joints: &HandJoints) -> Vec<(TaperedCapsule, Owner)> {
    let solids = HandSolids::of_joints(joints);
    let phalanges = solids.phalanges.iter().enumerate();
    let of_digits = phalanges.flat_map(|(digit, links)| links.map(|link| (link, Owner::Digit(digit))));
    let of_palm = solids.palm.iter().chain(&solids.thenar);
    let of_palm = of_palm.map(|&solid| (solid, Owner::Palm));
    let of_forearm = solids.forearm.map(|solid| (solid, Owner::Forearm));
    of_digits.chain(of_palm).chain(of_forearm).collect()
}

/// The gap between a solid and an object in metres, negative where they overlap, and cut off at [`FAR`].
fn gap(object: &GraspObject, solid: &TaperedCapsule, object_from_wrist: Pose) -> f32 {
    let placed = TaperedCapsule {
        start: object_from_wrist.transform_point(solid.start),
        end: object_from_wrist.transform_point(solid.end),
        ..*solid
    };
    // Farthest point of the solid from its middle.
    let reach = 0.5 * solid.start.distance(solid.end) + solid.start_radius.max(solid.end_radius);
    if object.bounding_box.distance(placed.start.midpoint(placed.end)) > reach + FAR {
        return FAR;
    }
    clearance(&placed, &object.surface, FAR)
}

struct Judged {
    cost: f32,
    placement: GiverPlacement,
}

fn judge(object: &GraspObject, parts: &[(TaperedCapsule, Owner)], object_from_wrist: Pose) -> Judged {
    let mut gap_of_digit = [FAR; 5];
    let mut palm_gap = FAR;
    let mut sunk = 0.0;
    let mut penetration: f32 = 0.0;
    for (solid, owner) in parts {
        let gap = gap(object, solid, object_from_wrist);
        match owner {
            Owner::Digit(digit) => gap_of_digit[*digit] = gap_of_digit[*digit].min(gap),
            Owner::Palm => palm_gap = palm_gap.min(gap),
            Owner::Forearm => {}
        }
        if gap < 0.0 {
            sunk += gap * gap;
            penetration = penetration.max(-gap);
        }
    }
    // The thumb and the two best fingers should touch; the palm may.
    let mut fingers = [gap_of_digit[1], gap_of_digit[2], gap_of_digit[3], gap_of_digit[4]];
    fingers.sort_by(f32::total_cmp);
    let away = |gap: f32| gap.max(0.0);
    let reach = away(gap_of_digit[0]) + away(fingers[0]) + 0.5 * away(fingers[1]) + 0.1 * away(palm_gap);
    let touching_digits = gap_of_digit.iter().filter(|&&gap| gap < TOUCH).count();
    Judged {
        // 1 mm of gap weighs as much as 1 mm of depth in ten solids.
        cost: reach + 100.0 * sunk,
        placement: GiverPlacement {
            object_from_wrist,
            penetration,
            touching_digits,
        },
    }
}

/// The best placement found; equal for equal arguments.
pub fn place_giver(object: &GraspObject, joints: &HandJoints, seed: u64) -> GiverPlacement {
    const SEEDS: usize = 1500;
    const REFINED: usize = 12;
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let parts = parts(joints);
    let position = |i: usize| joints.joints[i].pose.position;
    // Objects are held between the tips of the thumb and of index and middle finger.
    let grip = (2.0 * position(index::TIP_OF_DIGIT[0])
        + position(index::TIP_OF_DIGIT[1])
        + position(index::TIP_OF_DIGIT[2]))
        / 4.0;
    let half = object.bounding_box.half_extents;
    let long_axis = if half.x >= half.y && half.x >= half.z {
        Vec3::X
    } else if half.y >= half.z {
        Vec3::Y
    } else {
        Vec3::Z
    };
    let end = if random.random::<bool>() { 1.0 } else { -1.0 };
    let mut seeds: Vec<Judged> = (0..SEEDS)
        .map(|_| {
            let mut unit = || random.random::<f32>();
            let along = end * (0.3 + 0.5 * unit()) * half.dot(long_axis);
            let across = (Vec3::new(unit(), unit(), unit()) - 0.5) * half * (Vec3::ONE - long_axis);
            let target = object
                .bounding_box
                .object_from_box
                .transform_point(along * long_axis + across);
            let orientation = random_rotation(&mut random);
            judge(
                object,
                &parts,
                Pose::new(target - orientation * grip, orientation),
            )
        })
        .collect();
    seeds.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    seeds
        .into_iter()
        .take(REFINED)
        .map(|seed| refine(object, &parts, seed))
        .min_by(|a, b| a.cost.total_cmp(&b.cost))
        .expect("there are seeds")
        .placement
}

/// Pattern search: steps along and about each axis, halved when none helps.
fn refine(object: &GraspObject, parts: &[(TaperedCapsule, Owner)], seed: Judged) -> Judged {
    let mut best = seed;
    // Turns are about the middle of the hand, not about the wrist.
    let of_hand = parts.iter().filter(|(_, owner)| !matches!(owner, Owner::Forearm));
    let middles: Vec<Vec3> = of_hand
        .map(|(solid, _)| solid.start.midpoint(solid.end))
        .collect();
    let pivot = middles.iter().sum::<Vec3>() / middles.len() as f32;
    let (mut shift, mut turn) = (0.01_f32, 0.3_f32);
    while shift > 0.0002 {
        let from = best.placement.object_from_wrist;
        let mut improved = false;
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            for sign in [-1.0, 1.0] {
                let moved = Pose::new(from.position + sign * shift * axis, from.orientation);
                let pivot = from.transform_point(pivot);
                let rotation = Quat::from_axis_angle(axis, sign * turn);
                let turned = Pose::new(
                    pivot + rotation * (from.position - pivot),
                    (rotation * from.orientation).normalize(),
                );
                for candidate in [moved, turned] {
                    let judged = judge(object, parts, candidate);
                    if judged.cost < best.cost {
                        best = judged;
                        improved = true;
                    }
                }
            }
        }
        if !improved {
            shift *= 0.5;
            turn *= 0.5;
        }
    }
    best
}

/// Uniform over all rotations (Shoemake 1992, "Uniform random rotations").
fn random_rotation(random: &mut Xoshiro256PlusPlus) -> Quat {
    use std::f32::consts::TAU;
    let (u, v, w) = (
        random.random::<f32>(),
        TAU * random.random::<f32>(),
        TAU * random.random::<f32>(),
    );
    let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
    Quat::from_xyzw(a * v.sin(), a * v.cos(), b * w.sin(), b * w.cos())
}
