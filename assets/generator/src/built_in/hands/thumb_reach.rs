//! The thumb can oppose the fingers within its limits.

use glam::Vec3;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        DigitAngles, Handedness,
        kinematics::digit_frames,
        rig::{AngleRange, DigitRig},
    },
};

use super::built_in;

/// Pseudorandom numbers from 0 to 1 (Knuth's linear congruential generator).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1_u64 << 24) as f32
    }
}

/// The middle of a fingertip's pad and the direction it faces.
fn pad(digit: &DigitRig, angles: DigitAngles) -> (Vec3, Vec3) {
    let last = digit_frames(digit, Pose::IDENTITY, angles).links[2];
    let point = Vec3::new(0.0, 0.6 * digit.lengths[2], 0.5 * digit.diameters[2]);
    (last.transform_point(point), last.transform_vector(Vec3::Z))
}

/// Angles of thumb and finger by eight shares of their ranges.
fn posed(digits: [&DigitRig; 2], shares: &[f32; 8], coupled: bool) -> [DigitAngles; 2] {
    let within = |range: AngleRange, share: f32| range.min + share * (range.max - range.min);
    std::array::from_fn(|i| {
        let limits = digits[i].limits;
        let shares = &shares[4 * i..];
        let mut angles = DigitAngles::coupled(
            within(limits.base_yaw, shares[0]),
            within(limits.base_pitch, shares[1]),
            within(limits.second_pitch, shares[2]),
        );
        if !coupled {
            angles.third_pitch = within(limits.third_pitch, shares[3]);
        }
        angles
    })
}

/// Distance in metres and facing of the pads where the distance plus a penalty of 15 mm for pads at right angles is
/// least, by random descent.
fn closest(digits: [&DigitRig; 2], coupled: bool) -> (f32, f32) {
    let mut numbers = Numbers(7);
    let cost = |shares: &[f32; 8]| {
        let [thumb, finger] = posed(digits, shares, coupled);
        let ((p, n), (q, m)) = (pad(digits[0], thumb), pad(digits[1], finger));
        (p.distance(q) + 0.015 * (1.0 + n.dot(m)), p.distance(q), n.dot(m))
    };
    let mut best = (f32::INFINITY, f32::INFINITY, 0.0);
    for _ in 0..20 {
        let mut shares: [f32; 8] = std::array::from_fn(|_| numbers.next());
        let mut here = cost(&shares);
        for step in 0..600 {
            let reach = 0.4 * (1.0 - step as f32 / 600.0);
            let next = shares.map(|share| (share + reach * (2.0 * numbers.next() - 1.0)).clamp(0.0, 1.0));
            let there = cost(&next);
            if there.0 < here.0 {
                (shares, here) = (next, there);
            }
        }
        if here.0 < best.0 {
            best = here;
        }
    }
    (best.1, best.2)
}

#[test]
fn the_thumbs_pad_meets_those_of_index_and_middle_finger() {
    for (name, coupled) in [("thesis", true), ("adult", false)] {
        let rig = &built_in(name, Handedness::Right).rig;
        for finger in [1, 2] {
            let (distance, facing) = closest([&rig.digits[0], &rig.digits[finger]], coupled);
            println!("{name}, digit {finger}: {:.1} mm, {facing:.2}", 1e3 * distance);
            assert!(distance < 0.005, "{name}, digit {finger}: {distance} m apart");
            assert!(facing < -0.5, "{name}, digit {finger}: the pads face {facing}");
        }
    }
}

#[test]
fn the_thumb_of_a_flat_hand_faces_the_little_finger() {
    for name in ["thesis", "adult"] {
        let rig = &built_in(name, Handedness::Right).rig;
        let (_, facing) = pad(&rig.digits[0], DigitAngles::default());
        assert!(facing.x < -0.8, "the pad faces {facing}");
    }
}
