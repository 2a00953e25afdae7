//! Compares tracked joints with the adult rig: lengths of bones, axes of joints, and radii that a headset does not report.

use std::sync::LazyLock;

use glam::Vec3;
use grasp_assets::hands;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        HandPose, Handedness,
        joints::{HandJoints, JOINT_COUNT, Joint, index},
    },
};

type PerJoint<T> = [T; JOINT_COUNT];

/// The rig for tracked joints: its skin is posed on them, and its proportions are compared with theirs.
pub(super) const TRACKED_HAND_RIG: &str = "adult";

/// The joints of the palm and of each digit, from the wrist outward.
const CHAINS: [&[usize]; 6] = [
    &[index::WRIST, index::PALM],
    &[index::WRIST, 2, 3, 4, 5],
    &[index::WRIST, 6, 7, 8, 9, 10],
    &[index::WRIST, 11, 12, 13, 14, 15],
    &[index::WRIST, 16, 17, 18, 19, 20],
    &[index::WRIST, 21, 22, 23, 24, 25],
];

fn bones() -> impl Iterator<Item = [usize; 2]> {
    CHAINS
        .into_iter()
        .flat_map(|chain| chain.windows(2).map(|bone| [bone[0], bone[1]]))
}

/// The adult hand; both hands have the same proportions.
pub(super) static REFERENCE: LazyLock<Reference> = LazyLock::new(Reference::of_rig);

#[derive(Debug)]
pub(super) struct Reference {
    /// Length of the bone that ends at the joint; 0 for the wrist.
    pub bones: PerJoint<f32>,
    pub longest: PerJoint<f32>,
    pub radii: PerJoint<f32>,
}

impl Reference {
    fn of_rig() -> Self {
        let rig = &hands::hand(TRACKED_HAND_RIG, Handedness::Right)
            .expect("the rig is built in")
            .rig;
        let stretched = HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits: rig.stretched(),
        };
        let joints = HandJoints::of_pose(rig, &stretched).joints;
        let positions = joints.map(|joint| joint.pose.position);
        let mut lengths = [0.0; JOINT_COUNT];
        for [start, end] in bones() {
            lengths[end] = positions[start].distance(positions[end]);
        }
        let mut longest = lengths.map(|length| MAX_BONE * length);
        let palm_bone = |digit: usize| {
            let knuckle = positions[index::FIRST_OF_DIGIT[digit] + 1];
            MAX_PALM_BONE * knuckle.distance(positions[index::WRIST])
        };
        longest[index::PALM] = palm_bone(2);
        for digit in 1..5 {
            let metacarpal = index::FIRST_OF_DIGIT[digit];
            longest[metacarpal..=metacarpal + 1].fill(palm_bone(digit));
        }
        Self {
            bones: lengths,
            longest,
            radii: joints.map(|joint| joint.radius),
        }
    }

    /// The size of a hand relative to this one: the median of its bones' ratios. Bones between joints that are not
    /// `trusted`, and those without length, do not count; `None` if there are no others.
    pub(super) fn scale_of(&self, positions: &PerJoint<Vec3>, trusted: &PerJoint<bool>) -> Option<f32> {
        let mut ratios = [0.0; JOINT_COUNT];
        let mut count = 0;
        for [start, end] in bones() {
            let length = positions[start].distance(positions[end]);
            if trusted[start] && trusted[end] && length > 0.0 {
                ratios[count] = length / self.bones[end];
                count += 1;
            }
        }
        let ratios = &mut ratios[..count];
        ratios.sort_unstable_by(f32::total_cmp);
        ratios.get(count / 2).copied()
    }
}

/// Largest distance from a joint to the skin, in metres. Palms of large hands have about 0.03.
pub(super) const MAX_RADIUS: f32 = 0.1;

/// Gives each joint of radius 0 the adult rig's radius, scaled as that of the nearest joint of its digit that has one,
/// or else to the hand's size. Returns whether each was replaced.
pub(super) fn replace_missing(joints: &mut PerJoint<Joint>, scale: f32) -> PerJoint<bool> {
    let reference = &REFERENCE.radii;
    let sent = joints.map(|joint| joint.radius);
    let missing = sent.map(|radius| radius == 0.0);
    for (number, chain) in CHAINS.iter().enumerate() {
        // The wrist starts every chain; its radius goes with the palm's, in the first.
        for (place, &joint) in chain.iter().enumerate().skip(number.min(1)) {
            if missing[joint] {
                let known = chain.iter().enumerate().filter(|&(_, &other)| !missing[other]);
                let nearest = known.min_by_key(|&(other, _)| other.abs_diff(place));
                let factor = nearest.map_or(scale, |(_, &other)| sent[other] / reference[other]);
                joints[joint].radius = (factor * reference[joint]).min(MAX_RADIUS);
            }
        }
    }
    missing
}

/// Largest length of a digit's bone, relative to the adult rig's in a hand of the same size. Recorded hands stay below 1.6.
const MAX_BONE: f32 = 3.0;

/// Largest length of a bone in the palm, relative to the distance from the wrist to that finger's knuckle. A metacarpal
/// joint may be anywhere between the two; headsets disagree.
const MAX_PALM_BONE: f32 = 1.6;

/// Factor on the limits for bones of a joint at the client's origin, where lost joints are.
const AT_ORIGIN: f32 = 0.7;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StrayJoint {
    pub joint: usize,
    /// The joint at the other end of its bone.
    pub neighbour: usize,
    pub length: f32,
    /// Largest possible length in a hand of this size, in metres.
    pub limit: f32,
}

/// All joints in impossible places; `trusted` are the joints to examine, and afterwards the right ones. Removes the joint with the
/// largest share of impossible bones, again and again, until all bones between the others are possible.
pub(super) fn strays(positions: &PerJoint<Vec3>, trusted: &mut PerJoint<bool>) -> Vec<StrayJoint> {
    let mut strays = Vec::new();
    // Joints at zero may be lost; the hand's size is that of the others, if there are any.
    let mut sized = *trusted;
    for (sized, position) in sized.iter_mut().zip(positions) {
        *sized &= *position != Vec3::ZERO;
    }
    let reference = &*REFERENCE;
    let Some(scale) = reference
        .scale_of(positions, &sized)
        .or_else(|| reference.scale_of(positions, trusted))
    else {
        return strays;
    };
    while let Some(stray) = worst(positions, trusted, scale) {
        trusted[stray.joint] = false;
        strays.push(stray);
    }
    strays.sort_unstable_by_key(|stray| stray.joint);
    strays
}

#[derive(Clone, Copy, Default)]
struct Tally {
    bones: u8,
    impossible: u8,
    /// The impossible bone that exceeds its limit most.
    worst: Option<StrayJoint>,
}

/// The trusted joint with the largest share of impossible bones; ties go to joints at zero, then to the most impossible bones.
fn worst(positions: &PerJoint<Vec3>, trusted: &PerJoint<bool>, scale: f32) -> Option<StrayJoint> {
    let mut tallies = [Tally::default(); JOINT_COUNT];
    let at_zero = |joint: usize| positions[joint] == Vec3::ZERO;
    for chain in CHAINS {
        let mut start: Option<usize> = None;
        let mut limit = 0.0;
        for &end in chain {
            limit += scale * REFERENCE.longest[end];
            if !trusted[end] {
                continue;
            }
            if let Some(start) = start.replace(end) {
                if at_zero(start) || at_zero(end) {
                    limit *= AT_ORIGIN;
                }
                let length = positions[start].distance(positions[end]);
                let is_impossible = length > limit || is_lost(positions, trusted, [start, end]);
                for (joint, neighbour) in [(start, end), (end, start)] {
                    let tally = &mut tallies[joint];
                    tally.bones += 1;
                    tally.impossible += u8::from(is_impossible);
                    let is_worst = |worst: StrayJoint| worst.length - worst.limit < length - limit;
                    if is_impossible && tally.worst.is_none_or(is_worst) {
                        tally.worst = Some(StrayJoint {
                            joint,
                            neighbour,
                            length,
                            limit,
                        });
                    }
                }
            }
            limit = 0.0;
        }
    }
    let share = |tally: &Tally| f32::from(tally.impossible) / f32::from(tally.bones.max(1));
    tallies
        .iter()
        .enumerate()
        .filter(|(_, tally)| tally.impossible > 0)
        .max_by(|(a, first), (b, second)| {
            share(first)
                .total_cmp(&share(second))
                .then(at_zero(*a).cmp(&at_zero(*b)))
                .then(first.impossible.cmp(&second.impossible))
        })
        .and_then(|(_, tally)| tally.worst)
}

/// Whether both ends of a bone were set to zero, or one is at the wrist, where only metacarpal joints may be.
fn is_lost(positions: &PerJoint<Vec3>, trusted: &PerJoint<bool>, bone: [usize; 2]) -> bool {
    let at_wrist = |joint: usize| {
        joint != index::WRIST
            && !index::FIRST_OF_DIGIT.contains(&joint)
            && trusted[index::WRIST]
            && positions[joint] == positions[index::WRIST]
    };
    let zeroed = bone[0] != index::WRIST && bone.iter().all(|&joint| positions[joint] == Vec3::ZERO);
    zeroed || bone.into_iter().any(at_wrist)
}

/// Cosines of the largest angles between -Z and the bone that starts at the joint: 60 degrees, and 30 for the identity, which
/// lost joints report. Recorded hands have up to 21, at metacarpals.
const BONE: [f32; 2] = [0.5, 0.866_025_4];

/// The same for a tip and the bone that ends there, and for wrist and palm and the middle finger's knuckle: 80 and 45
/// degrees. Recorded hands have up to 19; runtimes agree less on these axes.
const LOOSE: [f32; 2] = [0.173_648_18, std::f32::consts::FRAC_1_SQRT_2];

/// Between +X and the line across the knuckles, but for the thumb's joints: 90 and 70 degrees. Recorded hands have up to 32.
const ROLL: [f32; 2] = [0.0, 0.342_020_15];

/// Shortest distance that gives a direction, in metres.
const SHORTEST: f32 = 1e-3;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TurnedJoint {
    pub joint: usize,
    /// True if +Y does not point out of the back of the hand; false if -Z points away from the bone.
    pub is_rolled: bool,
    pub angle: f32,
    pub limit: f32,
}

#[derive(Debug, Default)]
pub(super) struct Axes {
    pub turned: Vec<TurnedJoint>,
    /// Most joints point away from their bones: the whole hand is in another convention.
    pub are_foreign: bool,
    /// Most joints are upside down, but point along their bones: it is the other hand.
    pub are_mirrored: bool,
}

/// Examines the axes of the `trusted` joints: `OpenXR`'s look along -Z to the tip, with +Y out of the back of the hand.
/// `is_identity` are the joints that were sent with the identity as orientation.
pub(super) fn axes(
    joints: &PerJoint<Joint>,
    trusted: &PerJoint<bool>,
    is_identity: &PerJoint<bool>,
    handedness: Handedness,
) -> Axes {
    let mut turned = Vec::new();
    let across = across(joints, trusted, handedness);
    let (mut checked, mut away) = (0, 0);
    let (mut rolled, mut upside_down) = (0, 0);
    let degrees = |cosine: f32| cosine.clamp(-1.0, 1.0).acos().to_degrees();
    for joint in (0..JOINT_COUNT).filter(|&joint| trusted[joint]) {
        let orientation = joints[joint].pose.orientation;
        let mut is_turned = |is_rolled, cosine: f32, limits: [f32; 2]| {
            let limit = limits[usize::from(is_identity[joint])];
            if cosine < limit {
                turned.push(TurnedJoint {
                    joint,
                    is_rolled,
                    angle: degrees(cosine),
                    limit: degrees(limit),
                });
            }
            cosine < limit
        };
        if let Some((direction, limits)) = direction(joints, trusted, joint) {
            checked += 1;
            if is_turned(false, (orientation * Vec3::NEG_Z).dot(direction), limits) {
                away += 1;
                continue;
            }
        }
        let is_thumb = (index::FIRST_OF_DIGIT[0]..=index::TIP_OF_DIGIT[0]).contains(&joint);
        if let Some(across) = across.filter(|_| !is_thumb) {
            rolled += 1;
            upside_down += u32::from(is_turned(true, (orientation * Vec3::X).dot(across), ROLL));
        }
    }
    let are_foreign = 2 * away > checked;
    Axes {
        turned,
        are_foreign,
        are_mirrored: !are_foreign && 2 * upside_down > rolled,
    }
}

/// The unit vector along which a joint has to look, and its limits.
fn direction(joints: &PerJoint<Joint>, trusted: &PerJoint<bool>, joint: usize) -> Option<(Vec3, [f32; 2])> {
    let (start, end, limits) = if matches!(joint, index::WRIST | index::PALM) {
        (joint, index::FIRST_OF_DIGIT[2] + 1, LOOSE)
    } else {
        let chain = CHAINS.iter().find(|chain| chain.contains(&joint))?;
        let place = chain.iter().position(|&other| other == joint)?;
        match chain.get(place + 1) {
            Some(&next) => (joint, next, BONE),
            None => (chain[place - 1], joint, LOOSE),
        }
    };
    Some((unit(joints, trusted, start, end)?, limits))
}

/// The unit vector from one trusted joint to another that is not too near to give a direction.
fn unit(joints: &PerJoint<Joint>, trusted: &PerJoint<bool>, start: usize, end: usize) -> Option<Vec3> {
    let vector = joints[end].pose.position - joints[start].pose.position;
    let length = vector.length();
    (trusted[start] && trusted[end] && length >= SHORTEST).then(|| vector / length)
}

/// The unit vector across the knuckles, in the direction of +X of a hand that lies on its palm.
fn across(joints: &PerJoint<Joint>, trusted: &PerJoint<bool>, handedness: Handedness) -> Option<Vec3> {
    let [index, little] = [1, 4].map(|digit| index::FIRST_OF_DIGIT[digit] + 1);
    match handedness {
        Handedness::Left => unit(joints, trusted, little, index),
        Handedness::Right => unit(joints, trusted, index, little),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_radii_follow_their_neighbours_or_the_hands_size() {
        // The adult rig's radii, 20 % larger in the thumb and 10 % smaller elsewhere.
        let whole: PerJoint<Joint> = std::array::from_fn(|joint| Joint {
            pose: Pose::IDENTITY,
            radius: REFERENCE.radii[joint] * if (2..6).contains(&joint) { 1.2 } else { 0.9 },
        });
        for lost in [
            vec![5, 10, 15, 20, 25],
            vec![0],
            vec![1, 8, 9],
            (6..11).collect(),
            vec![],
        ] {
            let mut joints = whole;
            for &joint in &lost {
                joints[joint].radius = 0.0;
            }
            let replaced = replace_missing(&mut joints, 0.9);
            for joint in 0..JOINT_COUNT {
                assert_eq!(replaced[joint], lost.contains(&joint));
                assert!(
                    (joints[joint].radius / whole[joint].radius - 1.0).abs() < 1e-5,
                    "{joint}"
                );
            }
        }
        for size in [0.5, 100.0] {
            let mut joints = whole.map(|joint| Joint { radius: 0.0, ..joint });
            replace_missing(&mut joints, size);
            for (joint, reference) in joints.iter().zip(REFERENCE.radii) {
                assert!((joint.radius - (size * reference).min(MAX_RADIUS)).abs() < 1e-7);
            }
        }
    }
}
