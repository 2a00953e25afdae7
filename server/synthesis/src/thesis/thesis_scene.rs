//! The data shared by all attempts of Algorithm 1 at a holdout.

use std::sync::OnceLock;

use super::{
    closing_motion::{DigitMotion, hand_motion},
    immobility_validation::Load,
    wrenches::Wrench,
    wrist_placement::WristPlacer,
};
use crate::model::{bend_ratios::BendRatioChoice, hand::rig::Rig, holdout::Holdout, strategy::Strategy};

/// A holdout, the receiving hand, and the settings of Algorithm 1.
#[derive(Clone, Debug)]
pub(crate) struct ThesisScene<'a> {
    /// The object and how it is presented.
    pub holdout: &'a Holdout,
    /// The receiving hand.
    pub rig: &'a Rig,
    /// Which of the modifications of chapter 5 apply.
    pub strategy: Strategy,
    /// The bend ratios a digit may close with.
    pub bend_ratios: BendRatioChoice,
    /// Draws wrist frames: step 1.
    pub placer: WristPlacer<'a>,
    /// The weight and friction of the object.
    pub load: Load,
    /// Tabulated on first use, since it takes longer than a look-up of known grips, which does not need it.
    motion: OnceLock<[DigitMotion; 5]>,
}

impl<'a> ThesisScene<'a> {
    /// Prepares attempts at a holdout. `friction` is the coefficient of static friction; it must be positive.
    pub(crate) fn new(
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

    /// The closing motion of each digit, thumb first.
    pub(crate) fn motion(&self) -> &[DigitMotion; 5] {
        self.motion.get_or_init(|| hand_motion(self.rig))
    }
}
