//! The ladder of search strategies of the thesis' chapter 5, and what goes beyond it.

use serde::{Deserialize, Serialize};

use super::bend_ratios::BendRatioChoice;

/// How grasps are searched for. Of the ladder, each strategy adds a step to the one before.
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
    /// One way of choosing the bend ratios (5.4, Algorithm 13).
    E,
    /// First sufficient force distribution (5.6, Algorithm 14).
    F,
    /// Hands are placed where opposed surfaces suggest it ([`crate::propose`]), and grips that are known are tried first
    /// ([`crate::known::atlas`]). What counts as valid is the same.
    Guided,
}

/// Which grasps count as valid. Separate from the strategy: how they are searched for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Validity {
    /// As the thesis prints it (4.5).
    #[default]
    Thesis,
    /// Hands are solid, and forces are solved for instead of drawn ([`crate::physical`]).
    Physical,
}

/// Which of the valid grasps is the answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Choice {
    /// The first that is found.
    #[default]
    FirstValid,
    /// The best of all that are found until the deadline.
    BestWithinBudget,
}

impl Strategy {
    /// The ladder of chapter 5 in order.
    pub const LADDER: [Self; 6] = [Self::A, Self::B, Self::C, Self::D, Self::E, Self::F];

    /// Are placements pruned by the measures relative to the object?
    pub fn prunes_by_object(self) -> bool {
        self >= Self::B
    }

    /// Are placements pruned by the palm-CoM-palm angle?
    pub fn prunes_by_presenting_hand(self) -> bool {
        self >= Self::C
    }

    /// Does posing stop when the thumb has no contact?
    pub fn stops_without_thumb(self) -> bool {
        self >= Self::D
    }

    /// Are known grips tried, and hands perturbed near them? They are kept for what is valid under `PHYSICAL`.
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

    /// Is the first force distribution that suffices taken, instead of the best of a hundred?
    pub fn takes_first_force_distribution(self) -> bool {
        self >= Self::F
    }
}
