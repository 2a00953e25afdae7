//! How far apart a hand can touch.

use glam::Vec3;

use crate::{
    base::pose::Pose,
    model::hand::{
        Digit, DigitAngles, HandPose,
        kinematics::DigitPlane,
        rig::{AngleRange, Rig},
    },
    physical::solids::{HandSolids, link_radii},
};

/// Angles tried per joint range for a hand's span, and the factor that covers those between them: cos(7°) for a digit's
/// widest range, and then some.
const ANGLES: usize = 5;
const BETWEEN_ANGLES: f32 = 1.03;

/// An upper bound on the distance of two contacts of a hand, in metres: from fingertip to fingertip or palm, over all poses.
pub fn hand_span(rig: &Rig) -> f32 {
    let stretched = HandPose {
        frame_from_wrist: Pose::IDENTITY,
        digits: rig.stretched(),
    };
    let palm = HandSolids::of_pose(rig, &stretched).palm;
    let palm: Vec<(Vec3, f32)> = palm
        .iter()
        .flat_map(|solid| [(solid.start, solid.start_radius), (solid.end, solid.end_radius)])
        .collect();
    let tips = Digit::ALL.map(|digit| fingertips(rig, digit));
    let mut span = 0.0_f32;
    for (i, tips_of_digit) in tips.iter().enumerate() {
        for &(tip, radius) in tips_of_digit {
            let others = tips[i + 1..].iter().flatten().chain(&palm);
            for &(other, other_radius) in others {
                span = span.max(tip.distance(other) + radius + other_radius);
            }
        }
    }
    span * BETWEEN_ANGLES
}

/// The spheres at the tip of a digit over its range of poses, its outer joints straight or bent back, in the wrist's frame.
fn fingertips(rig: &Rig, digit: Digit) -> Vec<(Vec3, f32)> {
    let digit_rig = rig.digit(digit);
    let [.., tip_radius] = link_radii(rig, digit);
    let limits = &digit_rig.limits;
    let over = |range: AngleRange| {
        (0..ANGLES).map(move |i| range.min + (range.max - range.min) * i as f32 / (ANGLES - 1) as f32)
    };
    let straight = |range: AngleRange| [range.min, 0.0_f32.clamp(range.min, range.max)];
    let mut tips = Vec::new();
    for base_yaw in over(limits.base_yaw) {
        let plane = DigitPlane::new(digit_rig, Pose::IDENTITY, base_yaw);
        for base_pitch in over(limits.base_pitch) {
            for second_pitch in straight(limits.second_pitch) {
                for third_pitch in straight(limits.third_pitch) {
                    let [.., joint, tip] = plane.joints(&DigitAngles {
                        base_yaw,
                        base_pitch,
                        second_pitch,
                        third_pitch,
                    });
                    // The tip lies on the skin.
                    let inset = (joint - tip).normalize_or_zero() * tip_radius;
                    tips.push((tip + inset, tip_radius));
                }
            }
        }
    }
    tips
}
