//! The way of a hand from its present pose to a grasp, and its cost.

use std::sync::Arc;

use glam::Vec3;

use crate::{
    base::pose::Pose,
    model::{
        grasp::Grasp,
        hand::{
            Digit, HandPose,
            joints::{HandJoints, index},
            kinematics::digit_frames,
            rig::Rig,
        },
    },
    physical::{
        barriers::Barriers,
        grip::{GIVER_CLEARANCE, MAX_PENETRATION},
        solids::{HandSolids, PreparedHand, TrackedSolids, comes_within},
    },
    search::scene::Scene,
};

/// Cost of a turn by one radian, in metres: the points of a hand are 10 cm from its wrist on average. More prefers grasps that are
/// farther away in the same attitude.
pub const METRES_PER_RADIAN: f32 = 0.1;

/// Points at which the straight way is checked, its ends excluded. More notice thinner obstacles, and take 5 µs each.
const PARTS: u16 = 6;

/// Weight of the fingertips' way relative to the wrist's: it is short, and part of closing the hand anyway.
const FINGERTIPS: f32 = 0.5;

/// Extra cost of a blocked way, in metres: about the detour.
const DETOUR: f32 = 0.05;

/// Cost of a whole point of the score, in metres. Scores of valid grasps differ by some tenths.
const SCORE: f32 = 0.1;

/// The way of a wrist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WristWay {
    /// Distance in metres.
    pub(super) distance: f32,
    /// Angle in radians.
    pub(super) angle: f32,
}

impl WristWay {
    pub(super) fn between(from: Pose, to: Pose) -> Self {
        let turn = from.orientation.conjugate() * to.orientation;
        Self {
            distance: from.position.distance(to.position),
            // The cosine alone would not resolve small angles.
            angle: 2.0 * turn.xyz().length().atan2(turn.w.abs()),
        }
    }

    /// Its length in metres, with [`METRES_PER_RADIAN`].
    pub(super) fn length(self) -> f32 {
        self.distance + METRES_PER_RADIAN * self.angle
    }
}

/// The way of a hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandWay {
    /// Distance of the wrists, in metres.
    pub distance: f32,
    /// Angle between them, in radians.
    pub angle: f32,
    /// Mean distance that the fingertips move in the wrist's frame, in metres.
    pub fingertips: f32,
    /// True if the straight way is clear of barriers, and palm and forearm do not pass through the object.
    pub is_free: bool,
}

impl HandWay {
    /// The way from one hand to another of the scene's rig.
    pub fn between(scene: &Scene<'_>, from: &HandPose, to: &HandPose) -> Self {
        if from == to {
            return Self {
                distance: 0.0,
                angle: 0.0,
                fingertips: 0.0,
                is_free: true,
            };
        }
        let WristWay { distance, angle } = WristWay::between(from.frame_from_wrist, to.frame_from_wrist);
        Self {
            distance,
            angle,
            fingertips: fingertips(scene.task.rig, from, to),
            is_free: is_free(scene, from, to),
        }
    }
}

/// Cost of the way to a grasp if it is free, in metres.
pub(super) fn cost_if_free(rig: &Rig, from: &HandPose, to: &Grasp, score: f32) -> f32 {
    WristWay::between(from.frame_from_wrist, to.pose.frame_from_wrist).length()
        + FINGERTIPS * fingertips(rig, from, &to.pose)
        + SCORE * (1.0 - score)
}

pub(super) fn detour(scene: &Scene<'_>, from: &HandPose, to: &HandPose) -> f32 {
    if is_free(scene, from, to) { 0.0 } else { DETOUR }
}

/// Mean distance of the fingertips of two hands, each in its wrist's frame.
pub(super) fn fingertips(rig: &Rig, from: &HandPose, to: &HandPose) -> f32 {
    let tip = |digit: Digit, hand: &HandPose| {
        digit_frames(rig.digit(digit), Pose::IDENTITY, hand.digits[digit.index()]).tip
    };
    let digits = || Digit::ALL.into_iter().filter(|&digit| rig.has(digit));
    let sum: f32 = digits()
        .map(|digit| tip(digit, from).distance(tip(digit, to)))
        .sum();
    sum / digits().count().max(1) as f32
}

/// True if the hand, on a straight way between two poses, is clear of barriers, and palm and forearm of the object.
fn is_free(scene: &Scene<'_>, from: &HandPose, to: &HandPose) -> bool {
    let Some(around) = scene.surroundings().filter(|_| from != to) else {
        return true;
    };
    let surface = &around.object.object.surface;
    (1..PARTS).all(|part| {
        let pose = between(from, to, f32::from(part) / f32::from(PARTS));
        let solids = HandSolids::of_pose(scene.task.rig, &pose);
        let tracked = TrackedSolids::of_rig(scene.task.rig, pose.frame_from_wrist, &solids);
        let mut still = solids.palm.iter().chain(&solids.forearm);
        !still.any(|part| comes_within(part, surface, -MAX_PENETRATION))
            && !around.presented.barriers().comes_within(tracked.iter(), 0.0)
    })
}

/// A hand on the straight way from one pose to another; 0 is the start.
fn between(from: &HandPose, to: &HandPose, share: f32) -> HandPose {
    let (a, b) = (from.frame_from_wrist, to.frame_from_wrist);
    HandPose {
        frame_from_wrist: Pose::new(
            a.position.lerp(b.position, share),
            a.orientation.slerp(b.orientation, share).normalize(),
        ),
        digits: std::array::from_fn(|digit| from.digits[digit].toward(&to.digits[digit], share)),
    }
}

/// Most recent hands to keep clear of. More follow a motion more closely, and each takes a tenth of a millisecond per re-plan.
const MAX_HANDS: usize = 16;

/// Largest distance of two poses of a hand that count as the same, in metres: a headset's noise.
const ALIKE: f32 = 0.001;

/// Clearance from recent hands in metres, as no sway repeats itself to the millimetre.
const STEADY: f32 = GIVER_CLEARANCE + 0.002;

/// Cost of a metre less than [`STEADY`], in metres of a hand's way: a hand rather goes 10 cm than lacks a millimetre.
const LACK: f32 = 100.0;

/// Recent poses of other people's hands, including the present ones.
#[derive(Clone, Debug)]
pub(in crate::search) struct RecentHands(Vec<PreparedHand>);

impl RecentHands {
    /// Selects the hands that differ most; the last is the present one.
    pub(in crate::search) fn of(hands: &[Arc<HandJoints>]) -> Self {
        let mut chosen: Vec<&HandJoints> = hands.last().map(|hand| &**hand).into_iter().collect();
        let mut apart: Vec<f32> = vec![f32::INFINITY; hands.len()];
        while let Some(&last) = chosen.last() {
            for (apart, hand) in apart.iter_mut().zip(hands) {
                *apart = apart.min(distance(last, hand));
            }
            let farthest = apart.iter().zip(hands).max_by(|a, b| a.0.total_cmp(b.0));
            match farthest {
                Some((&apart, hand)) if apart > ALIKE && chosen.len() < MAX_HANDS => chosen.push(hand),
                _ => break,
            }
        }
        let prepared = |joints: &&HandJoints| PreparedHand::new(&TrackedSolids::of_joints(joints));
        Self(chosen.iter().map(prepared).collect())
    }

    /// The clearance that a hand lacks from all of them, in metres of way ([`super::way`]); 0 if it is clear.
    pub(in crate::search) fn lack(&self, hand: &TrackedSolids) -> f32 {
        let barriers = Barriers {
            hands: &self.0,
            ..Barriers::NONE
        };
        let least = barriers.least_distance(hand.iter(), STEADY, f32::NEG_INFINITY);
        LACK * least.map_or(0.0, |least| STEADY - least)
    }
}

/// The distance of two poses of a hand: the largest of wrist and fingertips.
fn distance(a: &HandJoints, b: &HandJoints) -> f32 {
    let at = |hand: &HandJoints, joint: usize| -> Vec3 { hand.joints[joint].pose.position };
    let ends = index::TIP_OF_DIGIT.into_iter().chain([index::WRIST]);
    ends.filter(|&joint| a.has(joint) && b.has(joint))
        .map(|joint| at(a, joint).distance(at(b, joint)))
        .fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;

    #[test]
    fn way_of_a_wrist_has_the_distance_and_the_angle_it_was_made_with() {
        let from = Pose::new(
            Vec3::new(0.1, -0.2, 0.3),
            Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.0),
        );
        for angle in [0.0, 1e-4, 0.3, 2.0, 3.1] {
            for sign in [1.0, -1.0] {
                let turn = Quat::from_axis_angle(Vec3::new(0.0, -0.8, 0.6), angle * sign);
                let to = Pose::new(
                    from.position + Vec3::new(0.0, 0.03, 0.04),
                    // Either of the quaternions of an orientation.
                    (from.orientation * turn) * sign,
                );
                let way = WristWay::between(from, to);
                assert!((way.distance - 0.05).abs() < 1e-6 && (way.angle - angle).abs() < 1e-5);
                assert!((way.length() - 0.05 - 0.1 * angle).abs() < 2e-6);
            }
        }
    }
}
