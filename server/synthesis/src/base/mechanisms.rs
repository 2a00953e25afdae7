//! The mechanisms of a default search (`GUIDED`, `PHYSICAL`). Each can be switched off to measure what it
//! contributes.
//!
//! Mechanisms propose, order and screen candidates; they never decide whether a grasp is valid. Without some of them,
//! a search is slower or finds fewer grasps, but never returns an invalid one.

use std::{fmt, str::FromStr};

/// A mechanism that makes a default search faster, or lets it find more or better grasps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Mechanism {
    /// Tries the atlas's grips before any new attempt.
    AtlasLookUp,
    /// With barriers present, tries a shortlist of complementary atlas grips first.
    Shortlists,
    /// Tries atlas grips by descending score under the request's gravity instead of in stored order.
    GravityOrder,
    /// Skips, in one step, all grips that share a grid cell with the giver's hand.
    CellOccupancy,
    /// Rejects a known hand whose inner spheres hit a barrier before the exact collision test.
    InnerSpheres,
    /// Tests the giver's most decisive solids first instead of following anatomical order.
    GiverOrder,
    /// Balances a known grip's forces with the friction that it is known to use, before less is tried.
    FrictionUses,
    /// After the atlas, tries grips that earlier searches found.
    LearnedGrips,
    /// Spends the first 300 µs of a search on known grips alone, before waking workers.
    HeadStart,
    /// Looks up known grips on the caller's own thread before handing the search to workers.
    CallerLookUp,
    /// After failed attempts, tries hands perturbed about grips of the atlas.
    Seeds,
    /// Without an atlas, perturbs hands about grips transferred from boxes that resemble the object.
    TransferredGrips,
    /// In every other attempt, uses only transferred grips whose contacts may have force closure on the object.
    ClosureScreen,
    /// Perturbs a hand that nearly has force closure a few times.
    NearMisses,
    /// Places hands where opposed pads fit opposed surface points instead of anywhere near the object.
    Oppositions,
    /// Orders placements by a network's estimate of how likely the hand is to hold there.
    SuccessPrior,
    /// Draws the first attempts from placements sampled once per object and rig.
    PlacementCache,
    /// Skips placements whose palm, forearm or links clearly collide before closing the hand.
    RoomScreen,
    /// Places some hands with the palm on the surface.
    PalmPlacement,
    /// Wraps handles with the whole hand, in most attempts at heavy objects.
    Handles,
    /// Preshapes the hand to the object's width before closing it.
    Preshape,
    /// Tucks fingers that do not take part into the palm, for some hands.
    TuckedFingers,
}

impl Mechanism {
    /// All mechanisms, in the order in which a search uses them.
    pub const ALL: [Self; 22] = [
        Self::AtlasLookUp,
        Self::Shortlists,
        Self::GravityOrder,
        Self::CellOccupancy,
        Self::InnerSpheres,
        Self::GiverOrder,
        Self::FrictionUses,
        Self::LearnedGrips,
        Self::HeadStart,
        Self::CallerLookUp,
        Self::Seeds,
        Self::TransferredGrips,
        Self::ClosureScreen,
        Self::NearMisses,
        Self::Oppositions,
        Self::SuccessPrior,
        Self::PlacementCache,
        Self::RoomScreen,
        Self::PalmPlacement,
        Self::Handles,
        Self::Preshape,
        Self::TuckedFingers,
    ];

    /// The kebab-case name that [`FromStr`] accepts.
    pub const fn name(self) -> &'static str {
        match self {
            Self::AtlasLookUp => "atlas-look-up",
            Self::Shortlists => "shortlists",
            Self::GravityOrder => "gravity-order",
            Self::CellOccupancy => "cell-occupancy",
            Self::InnerSpheres => "inner-spheres",
            Self::GiverOrder => "giver-order",
            Self::FrictionUses => "friction-uses",
            Self::LearnedGrips => "learned-grips",
            Self::HeadStart => "head-start",
            Self::CallerLookUp => "caller-look-up",
            Self::Seeds => "seeds",
            Self::TransferredGrips => "transferred-grips",
            Self::ClosureScreen => "closure-screen",
            Self::NearMisses => "near-misses",
            Self::Oppositions => "oppositions",
            Self::SuccessPrior => "success-prior",
            Self::PlacementCache => "placement-cache",
            Self::RoomScreen => "room-screen",
            Self::PalmPlacement => "palm-placement",
            Self::Handles => "handles",
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

/// A name that belongs to no mechanism.
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
        let found = Self::ALL.into_iter().find(|mechanism| mechanism.name() == name);
        found.ok_or_else(|| UnknownMechanism(name.to_owned()))
    }
}

/// The set of mechanisms that a search uses; all by default.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Mechanisms(u32);

impl Mechanisms {
    /// Every mechanism.
    pub const ALL: Self = Self((1 << Mechanism::ALL.len()) - 1);

    /// The set without one mechanism.
    #[must_use]
    pub const fn without(self, mechanism: Mechanism) -> Self {
        Self(self.0 & !mechanism.bit())
    }

    /// True if the mechanism is switched on.
    #[inline]
    pub const fn has(self, mechanism: Mechanism) -> bool {
        self.0 & mechanism.bit() != 0
    }

    /// Keeps the switches of `relevant` and turns all others on, for use as a cache key: searches that differ only in
    /// irrelevant mechanisms then share an entry.
    pub(crate) fn restricted_to(self, relevant: &[Mechanism]) -> Self {
        let off = relevant.iter().filter(|&&mechanism| !self.has(mechanism));
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
        for (index, mechanism) in Mechanism::ALL.into_iter().enumerate() {
            assert_eq!(mechanism as usize, index);
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
    fn rejects_unknown_name_and_lists_known_names() {
        let error = "luck".parse::<Mechanism>().unwrap_err().to_string();
        assert!(error.contains("\"luck\""), "{error}");
        for mechanism in Mechanism::ALL {
            assert!(error.contains(mechanism.name()), "{error} lacks {mechanism}");
        }
    }

    #[test]
    fn without_switches_off_only_that_mechanism() {
        for off in Mechanism::ALL {
            let rest = Mechanisms::ALL.without(off);
            for mechanism in Mechanism::ALL {
                assert_eq!(rest.has(mechanism), mechanism != off);
            }
            assert_eq!(format!("{rest:?}"), format!("all without {off}"));
        }
    }
}
