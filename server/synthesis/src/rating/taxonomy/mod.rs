//! Classifies grasps by the GRASP taxonomy (thesis 2.4). The thesis judges by eye and calls grasps of no type unnatural
//! (5.2, 6.1); this computes the type of every grasp.
//!
//! - [`GraspType`]: the types and the cells they belong to.
//! - [`classify`]: from a posed hand, its contacts and what it holds to a type. `features` and `held_part` measure, `scores`
//!   rates each type, `kinship` says which types an expert may take for each other.

mod features;
mod held_part;
mod kinship;
mod membership;
mod scores;
mod shape_fits;

use kinship::are_kin;

use crate::{
    geometry::local_shape::LocalShape,
    model::{
        grasp::Contact,
        grasp_type::{Classification, GraspType, MIN_CONFIDENCE},
        hand::{HandPose, rig::Rig},
    },
};

/// Share of the best rival's fit that is subtracted from the winner's if the two are not kin: a tie halves the confidence. A
/// larger one requires a clearer lead.
const DOUBT: f32 = 0.5;

/// The same share for kin. An expert who prefers the rival still accepts the winner.
const DOUBT_OF_KIN: f32 = 0.1;

/// Classifies a grasp from the receiving hand, its contacts and the shape of the held object, all in the same frame, in metres.
/// Independent of handedness and hand size.
pub fn classify(rig: &Rig, pose: &HandPose, contacts: &[Contact], shape: &LocalShape) -> Classification {
    let scores = scores::scores(&features::Features::of(rig, pose, contacts, shape));
    let mut best = 0;
    for (index, score) in scores.iter().enumerate() {
        if *score > scores[best] {
            best = index;
        }
    }
    let mut doubt = 0.0_f32;
    for (index, score) in scores.iter().enumerate().filter(|(index, _)| *index != best) {
        let share = if are_kin(best, index) { DOUBT_OF_KIN } else { DOUBT };
        doubt = doubt.max(share * score);
    }
    let confidence = scores[best] - doubt;
    Classification {
        grasp_type: (confidence >= MIN_CONFIDENCE).then_some(GraspType::ALL[best]),
        confidence,
    }
}
