//! What all attempts of Algorithm 1 at a holdout share.

use std::sync::OnceLock;

use super::{
    closing_motion::{DigitMotion, hand_motion},
    immobility_validation::Load,
    wrenches::Wrench,
    wrist_placement::WristPlacer,
};
use crate::model::{bend_ratios::BendRatioChoice, hand::rig::Rig, holdout::Holdout, strategy::Strategy};

/// A holdout, the receiving hand, and how Algorithm 1 tries to take it.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    /// What is held out.
    pub holdout: &'a Holdout,
    /// The receiving hand.
    pub rig: &'a Rig,
    /// The step of the ladder.
    pub strategy: Strategy,
    /// Which bend ratios a digit tries.
    pub bend_ratios: BendRatioChoice,
    /// Step 1.
    pub placer: WristPlacer<'a>,
    /// What a grasp has to hold.
    pub load: Load,
    /// Tabulated on first use: it takes longer than a look-up of known grips, which never needs it.
    motion: OnceLock<[DigitMotion; 5]>,
}

impl<'a> Scene<'a> {
    /// Prepares attempts at a holdout. `friction` is the coefficient of static friction, more than 0.
    pub fn new(
        holdout: &'a Holdout,
        rig: &'a Rig,
        strategy: Strategy,
        bend_ratios: BendRatioChoice,
        friction: f32,
    ) -> Self {
        debug_assert!(
            friction.is_finite() && friction > 0.0,
            "friction {friction} is not positive"
        );
        debug_assert!(
            holdout.up.is_normalized(),
            "up {} is not a unit vector",
            holdout.up
        );
        Self {
            holdout,
            rig,
            strategy,
            bend_ratios,
            placer: WristPlacer::new(holdout, rig, strategy),
            load: Load {
                gravity: Wrench::of_gravity(holdout.object.mass, holdout.up),
                centre_of_mass: holdout.object.centre_of_mass,
                friction,
            },
            motion: OnceLock::new(),
        }
    }

    /// How the digits close, step by step.
    pub fn motion(&self) -> &[DigitMotion; 5] {
        self.motion.get_or_init(|| hand_motion(self.rig))
    }
}
