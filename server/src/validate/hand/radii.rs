//! Replaces radii that a headset does not report.

use grasp_synthesis::model::hand::joints::{JOINT_COUNT, Joint};

use super::reference::{CHAINS, REFERENCE};

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
    use grasp_synthesis::base::pose::Pose;

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
