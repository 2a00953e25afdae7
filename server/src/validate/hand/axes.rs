//! Finds tracked joints whose axes contradict the hand: `OpenXR`'s joints look along -Z to the tip, with +Y out of the
//! back of the hand.

use glam::Vec3;
use grasp_synthesis::model::hand::{
    Handedness,
    joints::{JOINT_COUNT, Joint, index},
};

use super::reference::CHAINS;

/// Cosines of the largest angles: in general, and for the identity, which is what lost joints report.
#[derive(Clone, Copy, Debug)]
struct Limit {
    general: f32,
    identity: f32,
}

impl Limit {
    fn of(self, is_identity: bool) -> f32 {
        if is_identity { self.identity } else { self.general }
    }
}

/// Between -Z and the bone that starts at the joint: 60 and 30 degrees. Recorded hands have up to 21, at metacarpals.
const BONE: Limit = Limit {
    general: 0.5,
    identity: 0.866_025_4,
};

/// The same for a tip and the bone that ends there, and for wrist and palm and the middle finger's knuckle: 80 and 45
/// degrees. Recorded hands have up to 19; runtimes agree less on these axes.
const LOOSE: Limit = Limit {
    general: 0.173_648_18,
    identity: std::f32::consts::FRAC_1_SQRT_2,
};

/// Between +X and the line across the knuckles, but for the thumb's joints: 90 and 70 degrees. Recorded hands have up to 32.
const ROLL: Limit = Limit {
    general: 0.0,
    identity: 0.342_020_15,
};

/// Shortest distance that gives a direction, in metres.
const SHORTEST: f32 = 1e-3;

/// Why a joint's axes are wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// -Z points away from the bone.
    Direction,
    /// +Y does not point out of the back of the hand.
    Roll,
}

/// A joint whose axes are wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TurnedJoint {
    pub joint: usize,
    /// What is wrong.
    pub fault: Fault,
    /// The angle, in degrees.
    pub angle: f32,
    /// The limit, in degrees.
    pub limit: f32,
}

impl TurnedJoint {
    fn new(joint: usize, fault: Fault, cosine: f32, limit: f32) -> Self {
        let degrees = |cosine: f32| cosine.clamp(-1.0, 1.0).acos().to_degrees();
        Self {
            joint,
            fault,
            angle: degrees(cosine),
            limit: degrees(limit),
        }
    }
}

/// What is wrong with the axes of a hand.
#[derive(Debug, Default)]
pub(super) struct Axes {
    pub turned: Vec<TurnedJoint>,
    /// Most joints point away from their bones: the whole hand is in another convention.
    pub are_foreign: bool,
    /// Most joints are upside down, but point along their bones: it is the other hand.
    pub are_mirrored: bool,
}

/// Examines the axes of the `trusted` joints; `is_identity` are those that were sent with the identity as orientation.
pub(super) fn axes(
    joints: &[Joint; JOINT_COUNT],
    trusted: &[bool; JOINT_COUNT],
    is_identity: &[bool; JOINT_COUNT],
    handedness: Handedness,
) -> Axes {
    let mut axes = Axes::default();
    let across = across(joints, trusted, handedness);
    let (mut checked, mut away) = (0, 0);
    let (mut rolled, mut upside_down) = (0, 0);
    for joint in 0..JOINT_COUNT {
        if !trusted[joint] {
            continue;
        }
        let orientation = joints[joint].pose.orientation;
        let direction = direction(joints, trusted, joint);
        if let Some((direction, limit)) = direction {
            checked += 1;
            let cosine = (orientation * Vec3::NEG_Z).dot(direction);
            let limit = limit.of(is_identity[joint]);
            if cosine < limit {
                away += 1;
                axes.turned
                    .push(TurnedJoint::new(joint, Fault::Direction, cosine, limit));
                continue;
            }
        }
        let is_thumb = (index::FIRST_OF_DIGIT[0]..=index::TIP_OF_DIGIT[0]).contains(&joint);
        if let Some(across) = across.filter(|_| !is_thumb) {
            rolled += 1;
            let cosine = (orientation * Vec3::X).dot(across);
            let limit = ROLL.of(is_identity[joint]);
            if cosine < limit {
                upside_down += 1;
                axes.turned
                    .push(TurnedJoint::new(joint, Fault::Roll, cosine, limit));
            }
        }
    }
    axes.are_foreign = 2 * away > checked;
    axes.are_mirrored = !axes.are_foreign && 2 * upside_down > rolled;
    axes
}

/// The unit vector along which a joint has to look, and how exactly.
fn direction(
    joints: &[Joint; JOINT_COUNT],
    trusted: &[bool; JOINT_COUNT],
    joint: usize,
) -> Option<(Vec3, Limit)> {
    let (start, end, limit) = if matches!(joint, index::WRIST | index::PALM) {
        (joint, index::FIRST_OF_DIGIT[2] + 1, LOOSE)
    } else {
        let chain = CHAINS.iter().find(|chain| chain.contains(&joint))?;
        let place = chain.iter().position(|&other| other == joint)?;
        match chain.get(place + 1) {
            Some(&next) => (joint, next, BONE),
            None => (chain[place - 1], joint, LOOSE),
        }
    };
    let bone = joints[end].pose.position - joints[start].pose.position;
    (trusted[start] && trusted[end])
        .then(|| Some((unit(bone)?, limit)))
        .flatten()
}

/// The direction of a vector that is long enough to have one.
fn unit(vector: Vec3) -> Option<Vec3> {
    let length = vector.length();
    (length >= SHORTEST).then(|| vector / length)
}

/// The unit vector across the knuckles, in the direction of +X of a hand that lies on its palm.
fn across(
    joints: &[Joint; JOINT_COUNT],
    trusted: &[bool; JOINT_COUNT],
    handedness: Handedness,
) -> Option<Vec3> {
    let [index, little] = [1, 4].map(|digit| index::FIRST_OF_DIGIT[digit] + 1);
    let to_index = joints[index].pose.position - joints[little].pose.position;
    let across = match handedness {
        Handedness::Left => to_index,
        Handedness::Right => -to_index,
    };
    (trusted[index] && trusted[little])
        .then(|| unit(across))
        .flatten()
}
