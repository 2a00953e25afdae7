//! Search strategies: the ladder of the thesis's chapter 5, and the guided search; bend ratios (Algorithm 4, Figure 5.20).

use serde::{Deserialize, Serialize};

/// How to search for grasps. A to F form the ladder of chapter 5, in which each strategy adds a step to the previous
/// one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Strategy {
    /// Naive synthesis (5.2).
    A,
    /// Placement measures relative to the object (5.3, Algorithm 11).
    B,
    /// Palm-CoM-palm angle (5.3).
    C,
    /// Early stop when the thumb has no contact (5.4, Algorithm 12).
    D,
    /// One bend ratio per digit (5.4, Algorithm 13).
    E,
    /// First sufficient force distribution (5.6, Algorithm 14).
    F,
    /// Tries known grips first ([`crate::known::atlas`]), then places hands where opposed surfaces suggest a grasp
    /// ([`crate::propose`]). Validity is the same as for the other strategies.
    Guided,
}

/// Which grasps count as valid, independently of the strategy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Validity {
    /// As defined in the thesis (4.5).
    #[default]
    Thesis,
    /// Hands are solids, and forces are solved for instead of sampled ([`crate::physical`]).
    Physical,
}

/// Which valid grasp to return.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Choice {
    /// The first one found.
    #[default]
    FirstValid,
    /// The best one found before the deadline.
    BestWithinBudget,
}

impl Strategy {
    /// The ladder of chapter 5, in order.
    pub const LADDER: [Self; 6] = [Self::A, Self::B, Self::C, Self::D, Self::E, Self::F];

    /// True if the search tries known grips and hands perturbed about them. Known grips exist for `PHYSICAL` validity
    /// only.
    pub fn uses_known_grips(self, validity: Validity) -> bool {
        self == Self::Guided && validity == Validity::Physical
    }

    /// The bend ratios that chapter 5 uses at this step of the ladder.
    pub fn default_bend_ratios(self) -> BendRatioChoice {
        if self >= Self::E {
            BendRatioChoice::OneRandom
        } else {
            BendRatioChoice::All
        }
    }

    /// True if the first sufficient force distribution is taken instead of the best of a hundred.
    pub fn takes_first_force_distribution(self) -> bool {
        self >= Self::F
    }
}

/// The bend ratios of Algorithm 4: degrees of the second joint per degree of the base joint.
pub const BEND_RATIOS: [f32; 3] = [0.7, 1.0, 1.42];

/// Which bend ratios a digit tries: the columns of Figure 5.20.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BendRatioChoice {
    /// (a) 0.7, 1 and 1.42 in turn.
    All,
    /// (b) As (a), but the fingers skip 0.7.
    AllFingersWithoutLow,
    /// (c) One of the three, at random.
    OneRandom,
    /// (d) As (c), but the fingers skip 0.7.
    OneRandomFingersWithoutLow,
    /// (e) Only 1.
    OnlyOne,
    /// (f) Only 1.42.
    OnlyHigh,
}

/// The bend ratios that a digit (0 is the thumb) may try, as indices into [`BEND_RATIOS`] (Figure 5.20). The thumb
/// keeps 0.7 where only the fingers skip it.
pub(crate) fn allowed_ratios(choice: BendRatioChoice, digit: usize) -> &'static [usize] {
    match choice {
        BendRatioChoice::All | BendRatioChoice::OneRandom => &[0, 1, 2],
        BendRatioChoice::AllFingersWithoutLow | BendRatioChoice::OneRandomFingersWithoutLow => {
            if digit == 0 {
                &[0, 1, 2]
            } else {
                &[1, 2]
            }
        }
        BendRatioChoice::OnlyOne => &[1],
        BendRatioChoice::OnlyHigh => &[2],
    }
}
