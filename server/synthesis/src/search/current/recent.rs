//! Where other people's hands were lately: what follows a current grasp keeps clear of them there too, or the next frame of a
//! hand that sways would end it again.

use std::sync::Arc;

use glam::Vec3;

use crate::{
    model::hand::joints::{HandJoints, index},
    physical::{
        barriers::Barriers,
        grip::GIVER_CLEARANCE,
        solids::{PreparedHand, TrackedSolids},
    },
};

/// Most hands that are kept clear of. More follow a motion more closely, and each takes a tenth of a millisecond per re-plan.
const MAX_HANDS: usize = 16;

/// Largest distance of two poses of a hand that count as one, in metres: a headset's noise.
const ALIKE: f32 = 0.001;

/// Distance from recent hands that a motion like theirs leaves clear, in metres: no sway repeats itself to the millimetre.
const STEADY: f32 = GIVER_CLEARANCE + 0.002;

/// What a metre less than [`STEADY`] counts as, in metres of a hand's way: a hand had rather go 10 cm than be a millimetre short.
const LACK: f32 = 100.0;

/// Hands as they were lately, and are now.
#[derive(Clone, Debug)]
pub(in crate::search) struct RecentHands(Vec<PreparedHand>);

impl RecentHands {
    /// Those that differ most of some hands, of which the last is the present one.
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

    /// How far a hand is short of keeping clear of all of them, in metres as [`super::way`] counts a way; 0 if it does.
    pub(in crate::search) fn lack(&self, hand: &TrackedSolids) -> f32 {
        let barriers = Barriers {
            other_hands: &self.0,
            ..Barriers::NONE
        };
        let least = barriers.least_distance(hand.iter(), STEADY, f32::NEG_INFINITY);
        LACK * least.map_or(0.0, |least| STEADY - least)
    }
}

/// How far apart two poses of a hand are: the largest distance of wrist and fingertips.
fn distance(a: &HandJoints, b: &HandJoints) -> f32 {
    let at = |hand: &HandJoints, joint: usize| -> Vec3 { hand.joints[joint].pose.position };
    let ends = index::TIP_OF_DIGIT.into_iter().chain([index::WRIST]);
    ends.filter(|&joint| a.has(joint) && b.has(joint))
        .map(|joint| at(a, joint).distance(at(b, joint)))
        .fold(0.0, f32::max)
}
