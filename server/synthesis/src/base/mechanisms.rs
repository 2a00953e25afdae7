//! The mechanisms of a default search (`GUIDED`, `PHYSICAL`), each of which can be switched off to measure its worth.
//!
//! Mechanisms propose, order and screen; the checks that decide whether a grasp is valid are not among them. A search with
//! some switched off is slower or finds less, but never answers with an invalid grasp.

use std::{fmt, str::FromStr};

/// A mechanism that makes a default search faster, finds more, or finds better grasps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Mechanism {
    /// Grips of the atlas are tried before any fresh attempt.
    AtlasLookUp,
    /// Complementary grips of the atlas come first where there is a giver.
    Shortlists,
    /// The atlas' grips are tried by falling score under the request's gravity, instead of in the order in which it keeps them.
    GravityOrder,
    /// Grips that share a cell with the giver's hand are skipped, all at once.
    CellOccupancy,
    /// Spheres inside a known hand show that it meets the giver, before hands are compared exactly.
    InnerSpheres,
    /// The giver's solids are compared in the order in which they settle most, instead of in anatomical order.
    GiverOrder,
    /// Balancing a known grip starts from the friction that it is known to use.
    FrictionUses,
    /// Known grips are also tried without the fingers that the giver is in the way of.
    FingerSubsets,
    /// Grips that recent searches found are tried after those of the atlas.
    RecentGrips,
    /// The first 300 µs of a search go to known grips alone, before workers are woken.
    HeadStart,
    /// Known grips are looked up on the caller's own thread before the search is handed to others.
    CallerLookUp,
    /// Failed attempts go on with hands perturbed about known grips of the atlas.
    Seeds,
    /// Seeds are first taken from grips that are not certainly in the giver's way.
    OpenSeeds,
    /// Seeds are also taken from all grips, by their clearance from the giver.
    NearestSeeds,
    /// Without an atlas, failed attempts go on with hands perturbed about grips of boxes like the object.
    TransferredGrips,
    /// Every other attempt takes only transferred grips whose contacts may have closure on the object.
    ClosureScreen,
    /// A hand that nearly has closure is perturbed a few times.
    NearMisses,
    /// Hands are placed where opposed pads fit opposed points of the surface, instead of anywhere near the object.
    Oppositions,
    /// A network orders placements by how likely the hand is to hold there.
    SuccessPrior,
    /// The first attempts choose from placements that were drawn once per object and rig.
    PlacementCache,
    /// From the fifth attempt, placements are drawn only from what the giver leaves free of the surface.
    FreeSurface,
    /// Placements whose palm, forearm or links clearly collide are skipped before the hand is closed.
    RoomScreen,
    /// Some hands are laid on the surface with their palm.
    PalmPlacement,
    /// Hands are partly closed to the object's width before they close on it.
    Preshape,
    /// Some hands tuck fingers that do not close into the palm.
    TuckedFingers,
}

impl Mechanism {
    /// All of them, in the order of a search.
    pub const ALL: [Self; 25] = [
        Self::AtlasLookUp,
        Self::Shortlists,
        Self::GravityOrder,
        Self::CellOccupancy,
        Self::InnerSpheres,
        Self::GiverOrder,
        Self::FrictionUses,
        Self::FingerSubsets,
        Self::RecentGrips,
        Self::HeadStart,
        Self::CallerLookUp,
        Self::Seeds,
        Self::OpenSeeds,
        Self::NearestSeeds,
        Self::TransferredGrips,
        Self::ClosureScreen,
        Self::NearMisses,
        Self::Oppositions,
        Self::SuccessPrior,
        Self::PlacementCache,
        Self::FreeSurface,
        Self::RoomScreen,
        Self::PalmPlacement,
        Self::Preshape,
        Self::TuckedFingers,
    ];

    /// Its name in kebab case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::AtlasLookUp => "atlas-look-up",
            Self::Shortlists => "shortlists",
            Self::GravityOrder => "gravity-order",
            Self::CellOccupancy => "cell-occupancy",
            Self::InnerSpheres => "inner-spheres",
            Self::GiverOrder => "giver-order",
            Self::FrictionUses => "friction-uses",
            Self::FingerSubsets => "finger-subsets",
            Self::RecentGrips => "recent-grips",
            Self::HeadStart => "head-start",
            Self::CallerLookUp => "caller-look-up",
            Self::Seeds => "seeds",
            Self::OpenSeeds => "open-seeds",
            Self::NearestSeeds => "nearest-seeds",
            Self::TransferredGrips => "transferred-grips",
            Self::ClosureScreen => "closure-screen",
            Self::NearMisses => "near-misses",
            Self::Oppositions => "oppositions",
            Self::SuccessPrior => "success-prior",
            Self::PlacementCache => "placement-cache",
            Self::FreeSurface => "free-surface",
            Self::RoomScreen => "room-screen",
            Self::PalmPlacement => "palm-placement",
            Self::Preshape => "preshape",
            Self::TuckedFingers => "tucked-fingers",
        }
    }

    const fn bit(self) -> u32 {
        1 << self as u32
    }
}

impl fmt::Display for Mechanism {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A name that no mechanism has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownMechanism(String);

impl fmt::Display for UnknownMechanism {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = Mechanism::ALL.map(Mechanism::name).join(", ");
        write!(f, "unknown mechanism {:?}; it must be one of {names}", self.0)
    }
}

impl std::error::Error for UnknownMechanism {}

impl FromStr for Mechanism {
    type Err = UnknownMechanism;

    fn from_str(name: &str) -> Result<Self, UnknownMechanism> {
        let named = Self::ALL.into_iter().find(|mechanism| mechanism.name() == name);
        named.ok_or_else(|| UnknownMechanism(name.to_owned()))
    }
}

/// The mechanisms that a search runs; by default, all.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Mechanisms(u32);

impl Mechanisms {
    /// Every mechanism.
    pub const ALL: Self = Self((1 << Mechanism::ALL.len()) - 1);

    /// These without one.
    #[must_use]
    pub const fn without(self, mechanism: Mechanism) -> Self {
        Self(self.0 & !mechanism.bit())
    }

    /// True if a mechanism is switched on.
    #[inline]
    pub const fn has(self, mechanism: Mechanism) -> bool {
        self.0 & mechanism.bit() != 0
    }

    /// All but those of some that are off here: two searches that differ in others alone share what depends on `some`.
    pub(crate) fn only_of(self, some: &[Mechanism]) -> Self {
        let off = some.iter().filter(|&&mechanism| !self.has(mechanism));
        off.fold(Self::ALL, |all, &mechanism| all.without(mechanism))
    }
}

impl Default for Mechanisms {
    fn default() -> Self {
        Self::ALL
    }
}

impl fmt::Debug for Mechanisms {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("all")?;
        Mechanism::ALL
            .into_iter()
            .filter(|&mechanism| !self.has(mechanism))
            .try_for_each(|mechanism| write!(f, " without {mechanism}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_lists_every_mechanism_once() {
        for (place, mechanism) in Mechanism::ALL.into_iter().enumerate() {
            assert_eq!(mechanism as usize, place);
            assert!(Mechanisms::default().has(mechanism));
        }
    }

    #[test]
    fn names_parse_to_the_same_mechanism() {
        for mechanism in Mechanism::ALL {
            assert_eq!(mechanism.name().parse(), Ok(mechanism));
        }
    }

    #[test]
    fn unknown_name_is_refused_with_the_known_ones() {
        let error = "luck".parse::<Mechanism>().unwrap_err().to_string();
        assert!(error.contains("\"luck\""), "{error}");
        for mechanism in Mechanism::ALL {
            assert!(error.contains(mechanism.name()), "{error} lacks {mechanism}");
        }
    }

    #[test]
    fn without_switches_off_that_mechanism_alone() {
        for off in Mechanism::ALL {
            let rest = Mechanisms::ALL.without(off);
            for mechanism in Mechanism::ALL {
                assert_eq!(rest.has(mechanism), mechanism != off);
            }
            assert_eq!(format!("{rest:?}"), format!("all without {off}"));
        }
    }
}
