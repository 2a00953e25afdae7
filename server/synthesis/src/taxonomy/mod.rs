//! Which type of the GRASP taxonomy a grasp is (thesis 2.4). The thesis looks at its grasps and calls those unnatural that
//! are none (5.2, 6.1); this does the same with numbers, for every grasp.
//!
//! - [`GraspType`]: the types, and the cells that they share.
//! - [`classify`]: a posed hand with its contacts to a type. `features` takes the measures, `scores` weighs them.

mod features;
mod grasp_type;
mod membership;
mod scores;

pub use grasp_type::{Cell, GraspClass, GraspType, Opposition, ThumbPosition, VirtualFinger};

use crate::{
    grasp::Contact,
    hand::{HandPose, rig::Rig},
};

/// The confidence from which a grasp is said to be of a type. A higher one leaves more grasps without a type.
pub const LEAST_CONFIDENCE: f32 = 0.25;

/// Of the second-best score, the share that is taken from the best one: two types that fit equally well halve the
/// confidence. A higher one asks for a clearer lead.
const DOUBT: f32 = 0.5;

/// What a grasp was found to be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Classification {
    /// The type; none if the grasp is not like any: a person would not call it natural.
    pub grasp_type: Option<GraspType>,
    /// How sure that is: how well the best type fits, less half of how well the next one does; 0 to 1. Without a type,
    /// below [`LEAST_CONFIDENCE`].
    pub confidence: f32,
}

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
        grasp_type: best_type.filter(|_| confidence >= LEAST_CONFIDENCE),
        confidence,
    }
}
