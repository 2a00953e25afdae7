//! A grasp's score: named terms from 0 to 1, 1 being best, and their weighted mean.
//!
//! The weights are the project's choice: they put what an onlooker notices first, fingers and the place of the hand,
//! before what only forces show. [`crate::rating::scoring`] computes the terms.

/// How many terms there are.
pub const TERMS: usize = 12;

/// A number for each term, in the order of [`Term::ALL`].
pub type Values = [f32; TERMS];

/// What is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Term {
    /// E of Eq. 4.6 is small.
    Comfort,
    /// The forces that balance gravity press rather than rub.
    FrictionReserve,
    /// No contact has to press much harder than the weight asks for.
    Ease,
    /// Neighbouring fingers bend alike.
    SharedFlexion,
    /// As many digits touch as the weight asks for.
    EnoughDigits,
    /// The object lies on pads, not on the sides of digits.
    Pads,
    /// The grasp is of a type that people use: the taxonomy's, and surely. Grasps without a type look unnatural (thesis
    /// 5.2 and 6.1).
    NaturalType,
    /// Ferrari-Canny epsilon is well above what validity asks for.
    Closure,
    /// The object gives way little when it is pushed: palm and inner phalanges bear it, or many digits.
    Steadiness,
    /// The palm comes from the side away from the giver's (palm-CoM-palm angle, thesis 5.3).
    AwayFromGiver,
    /// The hand keeps off the giver's.
    GiverClearance,
    /// The hand keeps off forbidden surfaces.
    SterileDistance,
}

impl Term {
    /// All terms.
    pub const ALL: [Self; TERMS] = [
        Self::Comfort,
        Self::FrictionReserve,
        Self::Ease,
        Self::SharedFlexion,
        Self::EnoughDigits,
        Self::Pads,
        Self::NaturalType,
        Self::Closure,
        Self::Steadiness,
        Self::AwayFromGiver,
        Self::GiverClearance,
        Self::SterileDistance,
    ];

    /// The name in answers.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Comfort => "comfort",
            Self::FrictionReserve => "friction_reserve",
            Self::Ease => "ease",
            Self::SharedFlexion => "shared_flexion",
            Self::EnoughDigits => "enough_digits",
            Self::Pads => "pads",
            Self::NaturalType => "natural_type",
            Self::Closure => "closure",
            Self::Steadiness => "steadiness",
            Self::AwayFromGiver => "away_from_giver",
            Self::GiverClearance => "giver_clearance",
            Self::SterileDistance => "sterile_distance",
        }
    }

    /// How much it counts.
    pub const fn weight(self) -> f32 {
        match self {
            Self::Comfort | Self::Ease => 1.0,
            Self::Pads => 1.5,
            Self::EnoughDigits | Self::SharedFlexion => 2.0,
            // Steadiness, closure and friction reserve tell whether a simulation by others keeps a grip against pushes from
            // all sides, and are weighed as they do there: together, they tell the lost one of two grips in 79 of 100 cases
            // (600 grips). The other terms tell nothing there, and are for the eye.
            Self::Steadiness => 4.0,
            Self::Closure | Self::FrictionReserve | Self::NaturalType => 6.0,
            Self::AwayFromGiver => 0.75,
            Self::GiverClearance | Self::SterileDistance => 0.5,
        }
    }

    /// True if it depends on the hand and the object alone, not on gravity or the giver.
    pub const fn is_of_grip(self) -> bool {
        matches!(
            self,
            Self::SharedFlexion
                | Self::EnoughDigits
                | Self::Pads
                | Self::NaturalType
                | Self::Closure
                | Self::Steadiness
                | Self::SterileDistance
        )
    }
}

/// A grasp's score by its terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// From 0 to 1, 1 being best; in the order of [`Term::ALL`].
    pub values: Values,
}

impl Score {
    /// The terms' weighted mean.
    pub fn total(&self) -> f32 {
        weighted_mean(&self.values, |_| true)
    }

    /// The weighted mean of the terms that depend on hand and object alone, as a share of the whole.
    pub fn of_grip(&self) -> f32 {
        weighted_mean(&self.values, Term::is_of_grip)
    }
}

/// Sum of weighted terms that count, over the weight of all.
fn weighted_mean(values: &Values, counts: impl Fn(Term) -> bool) -> f32 {
    let whole: f32 = Term::ALL.iter().map(|term| term.weight()).sum();
    let sum: f32 = Term::ALL
        .iter()
        .zip(values)
        .filter(|(term, _)| counts(**term))
        .map(|(term, value)| term.weight() * value)
        .sum();
    sum / whole
}
