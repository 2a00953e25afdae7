//! The flesh of the palm as a hand's own joints tell it: tapered capsules from joint to joint, as wide as the joints'
//! radii say.

use glam::Vec3;

use super::TaperedCapsule;
use crate::hand::joints::{HandJoints, index};

/// Two `OpenXR` joints.
type Bone = [usize; 2];

/// `OpenXR` joints at the bases of the fingers' metacarpals.
const BASES: [usize; 4] = [
    index::FIRST_OF_DIGIT[1],
    index::FIRST_OF_DIGIT[2],
    index::FIRST_OF_DIGIT[3],
    index::FIRST_OF_DIGIT[4],
];

/// `OpenXR` joints at the knuckles.
const KNUCKLES: [usize; 4] = [BASES[0] + 1, BASES[1] + 1, BASES[2] + 1, BASES[3] + 1];

/// From one knuckle to the next.
const ACROSS_KNUCKLES: [Bone; 3] = neighbours(KNUCKLES);

/// From the wrist to the bases of the metacarpals, the thumb's last.
const FROM_WRIST: [Bone; 5] = [
    [index::WRIST, BASES[0]],
    [index::WRIST, BASES[1]],
    [index::WRIST, BASES[2]],
    [index::WRIST, BASES[3]],
    [index::WRIST, index::FIRST_OF_DIGIT[0]],
];

/// How many capsules [`around_metacarpals`] gives.
pub(super) const AROUND_METACARPALS: usize = ACROSS_KNUCKLES.len() + FROM_WRIST.len();

const fn neighbours(joints: [usize; 4]) -> [Bone; 3] {
    let [a, b, c, d] = joints;
    [[a, b], [b, c], [c, d]]
}

fn told(joints: &HandJoints, bone: Bone) -> TaperedCapsule {
    let [a, b] = bone.map(|joint| joints.joints[joint]);
    TaperedCapsule::new(a.pose.position, b.pose.position, a.radius, b.radius)
}

/// What is told of the palm behind the metacarpals and between their heads: from knuckle to knuckle, and from the wrist
/// to the bases.
pub(super) fn around_metacarpals(joints: &HandJoints) -> [TaperedCapsule; AROUND_METACARPALS] {
    let mut solids = [TaperedCapsule::default(); AROUND_METACARPALS];
    let bones = ACROSS_KNUCKLES.into_iter().chain(FROM_WRIST);
    for (solid, bone) in solids.iter_mut().zip(bones) {
        *solid = told(joints, bone);
    }
    solids
}

/// How far a point is from the skin of the palm that the joints' radii tell, in metres, from outside or inside: around the
/// four metacarpals, from one to the next across knuckles and bases, and from the wrist to the bases and the thumb's.
pub fn off_told_palm(joints: &HandJoints, point: Vec3) -> f32 {
    let along = BASES
        .into_iter()
        .zip(KNUCKLES)
        .map(|(base, knuckle)| [base, knuckle]);
    along
        .chain(neighbours(BASES))
        .chain(ACROSS_KNUCKLES)
        .chain(FROM_WRIST)
        .map(|bone| told(joints, bone).signed_distance(point))
        .fold(f32::INFINITY, f32::min)
        .abs()
}
