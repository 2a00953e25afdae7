//! A grasp's score: the weighted mean of named terms from 0 (worst) to 1 (best).
//!
//! The weights are the project's choice. [`crate::rating::scoring`] computes the terms, and [`super::regions`] those of an object
//! with regions.

/// Number of terms.
pub const TERMS: usize = 20;

/// One value per term, in the order of [`Term::ALL`].
pub type Values = [f32; TERMS];

/// A term of the score.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Term {
    /// The comfort cost E of Eq. 4.6 is small.
    Comfort,
    /// The forces that balance gravity use little friction.
    FrictionReserve,
    /// No contact presses much harder than the weight requires.
    Ease,
    /// Neighbouring fingers bend by similar angles.
    SharedFlexion,
    /// As much of the hand holds as the load requires: fingers for a light one, the whole hand for one that is heavy or held far
    /// from its centre of mass.
    EnoughDigits,
    /// The digits touch with their pads, not with their sides.
    Pads,
    /// The grasp belongs with high confidence to a type of the taxonomy. Grasps without a type look unnatural (thesis
    /// 5.2 and 6.1).
    NaturalType,
    /// The Ferrari-Canny epsilon is well above the required one.
    Closure,
    /// The grasp is stiff against pushes: palm and proximal phalanges, or many digits, support the object.
    Steadiness,
    /// The palm is on the side opposite the giver's (palm-CoM-palm angle, thesis 5.3).
    AwayFromGiver,
    /// The hand keeps its distance from the giver's and other hands.
    GiverClearance,
    /// The hand keeps its distance from forbidden surfaces.
    SterileDistance,
    /// The forearm comes from the receiver.
    Stance,
    /// The hand comes from the side or from above, not from beneath.
    FromSideOrAbove,
    /// The wrist carries little torque.
    WristLoad,
    /// The hand comes across the object's long axis, not from its end.
    AcrossLongAxis,
    /// The hand holds the object near its centre of mass, or by its handle.
    NearCentre,
    /// Thumb and fingers oppose across a small dimension of the object.
    SmallSpan,
    /// The hand holds the object by its handle, if it has one.
    OnHandle,
    /// No contact is on a sharp edge or point.
    OffSharp,
}

/// All terms: name, weight, and whether it depends on the hand and the object alone. Firmness is weighted by how well it predicts
/// which grips survive pushes from all sides in an independent simulation; the hand's direction and place, which people notice
/// first, by how well they tell natural hands from others (`tests/src/pairs.csv`).
const TABLE: [(Term, &str, f32, bool); TERMS] = [
    (Term::Comfort, "comfort", 1.0, false),
    (Term::FrictionReserve, "friction_reserve", 10.0, false),
    (Term::Ease, "ease", 1.0, false),
    (Term::SharedFlexion, "shared_flexion", 2.0, true),
    (Term::EnoughDigits, "enough_digits", 4.0, true),
    (Term::Pads, "pads", 1.5, true),
    (Term::NaturalType, "natural_type", 6.0, true),
    (Term::Closure, "closure", 6.0, true),
    (Term::Steadiness, "steadiness", 10.0, true),
    (Term::AwayFromGiver, "away_from_giver", 2.0, false),
    (Term::GiverClearance, "giver_clearance", 0.5, false),
    (Term::SterileDistance, "sterile_distance", 0.5, true),
    (Term::Stance, "stance", 12.0, false),
    (Term::FromSideOrAbove, "from_side_or_above", 6.0, false),
    (Term::WristLoad, "wrist_load", 2.0, false),
    (Term::AcrossLongAxis, "across_long_axis", 6.0, true),
    (Term::NearCentre, "near_centre", 4.0, true),
    (Term::SmallSpan, "small_span", 1.5, true),
    (Term::OnHandle, "on_handle", 13.0, true),
    (Term::OffSharp, "off_sharp", 6.0, true),
];

impl Term {
    /// All terms.
    pub const ALL: [Self; TERMS] = {
        let mut all = [Self::Comfort; TERMS];
        let mut index = 0;
        while index < TERMS {
            all[index] = TABLE[index].0;
            index += 1;
        }
        all
    };

    /// The name used in answers.
    pub const fn name(self) -> &'static str {
        TABLE[self as usize].1
    }

    /// The weight in the mean, relative to the other terms.
    pub const fn weight(self) -> f32 {
        TABLE[self as usize].2
    }

    /// The weight as a share of the weights of all terms.
    pub fn share(self) -> f32 {
        self.weight() / weight_of_all()
    }

    /// True if the term depends on the hand and the object alone, not on gravity or the giver.
    pub const fn is_grip_term(self) -> bool {
        TABLE[self as usize].3
    }
}

fn weight_of_all() -> f32 {
    Term::ALL.iter().map(|term| term.weight()).sum()
}

/// A term of the score that only objects with regions have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegionTerm {
    /// The contacts are on preferred regions.
    OnPreferred,
    /// The contacts are off regions to avoid.
    OffAvoided,
}

impl RegionTerm {
    /// All terms.
    pub const ALL: [Self; 2] = [Self::OnPreferred, Self::OffAvoided];

    /// The name used in answers.
    pub const fn name(self) -> &'static str {
        match self {
            Self::OnPreferred => "on_preferred",
            Self::OffAvoided => "off_avoided",
        }
    }
}

/// Weight in the mean of a region term of the greatest importance.
const REGION_WEIGHT: f32 = 30.0;

/// A region term's value for a grasp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionValue {
    /// From 0 (worst) to 1 (best).
    pub value: f32,
    /// Its importance: the largest weight of a region, more than 0 and at most 1.
    pub importance: f32,
}

impl RegionValue {
    /// The weight in the mean, relative to the other terms.
    pub fn weight(self) -> f32 {
        REGION_WEIGHT * self.importance
    }
}

/// The values of [`RegionTerm::ALL`]; `None` if the object has no such regions.
pub(crate) type RegionValues = [Option<RegionValue>; RegionTerm::ALL.len()];

/// A term of one score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoredTerm {
    /// The name used in answers.
    pub name: &'static str,
    /// From 0 (worst) to 1 (best).
    pub value: f32,
    /// The weight in the mean, relative to the other terms.
    pub weight: f32,
}

/// A grasp's score, term by term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Values from 0 (worst) to 1 (best), in the order of [`Term::ALL`].
    pub values: Values,
    /// Values of the terms for the object's regions.
    pub regions: RegionValues,
}

impl Score {
    /// The weighted mean of all terms, 0 to 1.
    pub fn total(&self) -> f32 {
        let common = mean_value(&self.values);
        if self.regions == RegionValues::default() {
            return common;
        }
        let weight_of_common = weight_of_all();
        let of_regions = self.regions.iter().flatten();
        let (sum, weights) = of_regions
            .fold((common * weight_of_common, weight_of_common), |(sum, all), of| {
                (sum + of.value * of.weight(), all + of.weight())
            });
        sum / weights
    }

    /// The terms that count.
    pub fn terms(&self) -> impl Iterator<Item = ScoredTerm> {
        let common = Term::ALL.into_iter().zip(self.values);
        let common = common.map(|(term, value)| ScoredTerm {
            name: term.name(),
            value,
            weight: term.weight(),
        });
        let of_regions = RegionTerm::ALL.into_iter().zip(self.regions);
        common.chain(of_regions.filter_map(|(term, earned)| {
            earned.map(|earned| ScoredTerm {
                name: term.name(),
                value: earned.value,
                weight: earned.weight(),
            })
        }))
    }
}

/// The weighted mean of values to which terms that are left out contribute 0.
pub(crate) fn mean_value(values: &Values) -> f32 {
    weighted_mean(values, |_| true)
}

/// The contribution to [`mean_value`] of the terms that depend on hand and object alone.
pub(crate) fn grip_total(values: &Values) -> f32 {
    weighted_mean(values, Term::is_grip_term)
}

/// The weighted sum of the terms that `counts` accepts, divided by the weight of all terms.
fn weighted_mean(values: &Values, counts: impl Fn(Term) -> bool) -> f32 {
    let sum: f32 = Term::ALL
        .iter()
        .zip(values)
        .filter(|(term, _)| counts(**term))
        .map(|(term, value)| term.weight() * value)
        .sum();
    sum / weight_of_all()
}
