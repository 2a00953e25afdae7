//! Classifies grasps by the GRASP taxonomy (thesis 2.4). The thesis judges by eye and calls grasps of no type unnatural
//! (5.2, 6.1); this computes the type of every grasp.
//!
//! - [`GraspType`]: the types and the cells they belong to.
//! - [`classify`]: from a posed hand and its contacts to a type. `features` measures, `scores` rates each type.

mod features;
mod membership;
mod scores;

use crate::model::{
    grasp::Contact,
    grasp_type::{Classification, GraspType, MIN_CONFIDENCE},
    hand::{HandPose, rig::Rig},
};

/// Share of the second-best score subtracted from the best to give the confidence, which a tie therefore halves. A larger
/// one requires a clearer lead.
const DOUBT: f32 = 0.5;

/// Classifies a grasp from the receiving hand and its contacts, both in the same (arbitrary) frame, in metres. Independent
/// of handedness and hand size.
pub fn classify(rig: &Rig, pose: &HandPose, contacts: &[Contact]) -> Classification {
    let scores = scores::scores(&features::Features::of(rig, pose, contacts));
    let (mut best, mut second, mut best_type) = (0.0, 0.0, None);
    for (grasp_type, score) in GraspType::ALL.into_iter().zip(scores) {
        if score > best {
            second = best;
            best = score;
            best_type = Some(grasp_type);
        } else if score > second {
            second = score;
        }
    }
    let confidence = best - DOUBT * second;
    Classification {
        grasp_type: best_type.filter(|_| confidence >= MIN_CONFIDENCE),
        confidence,
    }
}
