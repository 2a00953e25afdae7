//! Finds tracked joints that cannot be where they are: those that lost tracking and jumped, or were set to zero.
//!
//! Runtimes report such joints at the origin of their space or far off, while the others are right. The bones then are
//! too long. Limits are relative to the hand's own size, so that they hold for children and for large cartoon hands.

use std::sync::LazyLock;

use glam::Vec3;
use grasp_synthesis::model::hand::joints::{JOINT_COUNT, index};

use super::reference::{CHAINS, REFERENCE};

/// Largest length of a digit's bone, relative to the adult rig's in a hand of the same size. Recorded hands stay below 1.6.
const MAX_BONE: f32 = 3.0;

/// Largest length of a bone in the palm, relative to the distance from the wrist to that finger's knuckle. A metacarpal
/// joint may be anywhere between the two; headsets disagree.
const MAX_PALM_BONE: f32 = 1.6;

/// Factor on the limits for bones of a joint at the client's origin, where lost joints are.
const AT_ORIGIN: f32 = 0.7;

/// A joint that cannot be where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StrayJoint {
    pub joint: usize,
    /// The joint at the other end of its bone.
    pub neighbour: usize,
    /// Length of that bone, in metres.
    pub length: f32,
    /// Largest possible length in a hand of this size, in metres.
    pub limit: f32,
}

/// All joints that cannot be where they are; `trusted` are those to examine, and afterwards those that are right. One joint after the other is taken out, always the one with the largest share of impossible bones, until the bones
/// between the others are possible.
pub(super) fn strays(positions: &[Vec3; JOINT_COUNT], trusted: &mut [bool; JOINT_COUNT]) -> Vec<StrayJoint> {
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

/// A joint's bones.
#[derive(Clone, Copy, Default)]
struct Tally {
    bones: u8,
    impossible: u8,
    /// The impossible bone that exceeds its limit most.
    worst: Option<StrayJoint>,
}

/// The trusted joint with the largest share of impossible bones, if there are any; among equals, one at zero, then the
/// one with the most.
fn worst(positions: &[Vec3; JOINT_COUNT], trusted: &[bool; JOINT_COUNT], scale: f32) -> Option<StrayJoint> {
    let mut tallies = [Tally::default(); JOINT_COUNT];
    for chain in CHAINS {
        let mut start: Option<usize> = None;
        let mut limit = 0.0;
        for &end in chain {
            limit += scale * MAX_BONES[end];
            if !trusted[end] {
                continue;
            }
            if let Some(start) = start {
                if positions[start] == Vec3::ZERO || positions[end] == Vec3::ZERO {
                    limit *= AT_ORIGIN;
                }
                let length = positions[start].distance(positions[end]);
                let is_impossible = length > limit || is_lost(positions, trusted, [start, end]);
                for (joint, neighbour) in [(start, end), (end, start)] {
                    let tally = &mut tallies[joint];
                    tally.bones += 1;
                    tally.impossible += u8::from(is_impossible);
                    if is_impossible
                        && tally
                            .worst
                            .is_none_or(|worst| worst.length - worst.limit < length - limit)
                    {
                        tally.worst = Some(StrayJoint {
                            joint,
                            neighbour,
                            length,
                            limit,
                        });
                    }
                }
            }
            start = Some(end);
            limit = 0.0;
        }
    }
    let share = |tally: &Tally| f32::from(tally.impossible) / f32::from(tally.bones.max(1));
    tallies
        .iter()
        .enumerate()
        .filter(|(_, tally)| tally.impossible > 0)
        .max_by(|(a, first), (b, second)| {
            let at_zero = |joint: usize| positions[joint] == Vec3::ZERO;
            share(first)
                .total_cmp(&share(second))
                .then(at_zero(*a).cmp(&at_zero(*b)))
                .then(first.impossible.cmp(&second.impossible))
        })
        .and_then(|(_, tally)| tally.worst)
}

/// Largest length of the bone that ends at each joint, in an adult's hand, in metres.
static MAX_BONES: LazyLock<[f32; JOINT_COUNT]> = LazyLock::new(|| {
    let reference = &*REFERENCE;
    let mut longest = reference.bones.map(|length| MAX_BONE * length);
    let palm_bone = |digit: usize| MAX_PALM_BONE * reference.reach[index::FIRST_OF_DIGIT[digit] + 1];
    longest[index::PALM] = palm_bone(2);
    for digit in 1..5 {
        let metacarpal = index::FIRST_OF_DIGIT[digit];
        longest[metacarpal..=metacarpal + 1].fill(palm_bone(digit));
    }
    longest
});

/// Whether both ends of a bone were set to zero, or one is at the wrist, where only metacarpal joints may be.
fn is_lost(positions: &[Vec3; JOINT_COUNT], trusted: &[bool; JOINT_COUNT], bone: [usize; 2]) -> bool {
    let at_wrist = |joint: usize| {
        joint != index::WRIST
            && !index::FIRST_OF_DIGIT.contains(&joint)
            && trusted[index::WRIST]
            && positions[joint] == positions[index::WRIST]
    };
    let zeroed = bone[0] != index::WRIST && bone.iter().all(|&joint| positions[joint] == Vec3::ZERO);
    zeroed || bone.into_iter().any(at_wrist)
}
