//! The proportions of a hand: those of the adult rig, which also gives radii that a headset does not report.

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

/// The rig for tracked joints: its skin is posed on them, and its proportions are compared with theirs.
pub(super) const TRACKED_HAND_RIG: &str = "adult";

/// The joints of the palm and of each digit, from the wrist outward.
pub(super) const CHAINS: [&[usize]; 6] = [
    &[index::WRIST, index::PALM],
    &[index::WRIST, 2, 3, 4, 5],
    &[index::WRIST, 6, 7, 8, 9, 10],
    &[index::WRIST, 11, 12, 13, 14, 15],
    &[index::WRIST, 16, 17, 18, 19, 20],
    &[index::WRIST, 21, 22, 23, 24, 25],
];

/// The adult hand; both hands have the same proportions.
pub(super) static REFERENCE: LazyLock<Reference> = LazyLock::new(Reference::of_rig);

/// Lengths of a hand, in metres, by the joint's `OpenXR` index.
#[derive(Debug)]
pub(super) struct Reference {
    /// Length of the bone that ends at the joint; 0 for the wrist.
    pub bones: [f32; JOINT_COUNT],
    /// Distance of the joint from the wrist with the hand stretched.
    pub reach: [f32; JOINT_COUNT],
    /// Distance from the joint to the skin.
    pub radii: [f32; JOINT_COUNT],
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
        let mut bones = [0.0; JOINT_COUNT];
        for chain in CHAINS {
            for pair in chain.windows(2) {
                let [start, end] = [pair[0], pair[1]].map(|joint| joints[joint].pose.position);
                bones[pair[1]] = start.distance(end);
            }
        }
        Self {
            bones,
            reach: joints.map(|joint| joint.pose.position.distance(joints[index::WRIST].pose.position)),
            radii: joints.map(|joint| joint.radius),
        }
    }

    /// The size of a hand relative to this one: the median of its bones' ratios. Bones between joints that are not
    /// `trusted`, and those without length, do not count; `None` if there are no others.
    pub(super) fn scale_of(
        &self,
        positions: &[Vec3; JOINT_COUNT],
        trusted: &[bool; JOINT_COUNT],
    ) -> Option<f32> {
        let mut ratios = [0.0; JOINT_COUNT];
        let mut count = 0;
        for chain in CHAINS {
            for pair in chain.windows(2) {
                let length = positions[pair[0]].distance(positions[pair[1]]);
                if trusted[pair[0]] && trusted[pair[1]] && length > 0.0 {
                    ratios[count] = length / self.bones[pair[1]];
                    count += 1;
                }
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
pub(super) fn replace_missing(joints: &mut [Joint; JOINT_COUNT], scale: f32) -> [bool; JOINT_COUNT] {
    let reference = &REFERENCE.radii;
    let sent = joints.map(|joint| joint.radius);
    let missing = sent.map(|radius| radius == 0.0);
    for (number, chain) in CHAINS.iter().enumerate() {
        // The wrist starts every chain; its radius goes with the palm's, in the first.
        for (place, &joint) in chain.iter().enumerate().skip(number.min(1)) {
            if !missing[joint] {
                continue;
            }
            let nearest = chain
                .iter()
                .enumerate()
                .filter(|&(_, &other)| !missing[other])
                .min_by_key(|&(other, _)| other.abs_diff(place));
            let factor = nearest.map_or(scale, |(_, &other)| sent[other] / reference[other]);
            joints[joint].radius = (factor * reference[joint]).min(MAX_RADIUS);
        }
    }
    missing
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The adult rig's radii, 20 % larger in the thumb and 10 % smaller elsewhere.
    fn hand() -> [Joint; JOINT_COUNT] {
        std::array::from_fn(|joint| Joint {
            pose: Pose::IDENTITY,
            radius: REFERENCE.radii[joint] * if (2..6).contains(&joint) { 1.2 } else { 0.9 },
        })
    }

    #[test]
    fn missing_radii_follow_their_neighbours() {
        let whole = hand();
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
    }

    #[test]
    fn hand_without_radii_gets_those_of_its_size() {
        let mut joints = hand().map(|joint| Joint { radius: 0.0, ..joint });
        replace_missing(&mut joints, 0.5);
        for (joint, expected) in joints.iter().zip(REFERENCE.radii) {
            assert!((joint.radius - 0.5 * expected).abs() < 1e-7);
        }
        // However large it is.
        let mut joints = joints.map(|joint| Joint { radius: 0.0, ..joint });
        replace_missing(&mut joints, 100.0);
        assert!(joints.iter().all(|joint| joint.radius <= MAX_RADIUS));
    }
}
