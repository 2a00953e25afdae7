//! Which type of the GRASP taxonomy a grasp is (thesis 2.4). The thesis looks at its grasps and calls those unnatural that
//! are none (5.2, 6.1); this does the same with numbers, for every grasp.
//!
//! - [`GraspType`]: the types, and the cells that they share.
//! - [`classify`]: a posed hand with its contacts to a type. `features` takes the measures, `scores` weighs them.

mod features;
mod membership;
mod scores;

use crate::model::{
    grasp::Contact,
    grasp_type::{Classification, GraspType, MIN_CONFIDENCE},
    hand::{HandPose, rig::Rig},
};

/// Of the second-best score, the share that is taken from the best one: two types that fit equally well halve the
/// confidence. A higher one asks for a clearer lead.
const DOUBT: f32 = 0.5;

/// The type of a grasp from the receiving hand and its contacts, both in the same frame (any), in metres. The same for
/// left and right hands and for hands of any size.
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
