//! The grips that attempts start from once a hand that was placed anew fails.

use std::sync::{Arc, OnceLock};

use super::{
    atlas::Atlas,
    entry::Entry,
    grips::Grips,
    seeds::Seeds,
    transferred_grips::{Among, TransferredGrips},
};
use crate::{
    base::mechanisms::{Mechanism, Mechanisms},
    model::{constraints::Constraints, hand::rig::Rig},
    physical::scene::Presented,
};

/// Attempts that start from those known grips alone that are not certainly in the giver's way, which are found in a fifth of
/// the time: 0.8 ms instead of 4. Of later ones, every other does. Of 51 holdouts that atlases of the built-in objects do
/// not answer, hands beside these hold as soon as hands beside those that are nearest to keeping clear of all, and beside
/// some givers sooner or later by a tenfold.
const ATTEMPTS_FROM_OPEN_SEEDS: u64 = 8;

/// Where grips to start from come from.
#[derive(Clone, Debug, Default)]
pub enum SeedSource {
    /// There are none.
    #[default]
    Nothing,
    /// Grips that hold the object.
    Atlas(Arc<Atlas>),
    /// Grips that hold something like it, where it has no atlas yet.
    Transferred(Arc<TransferredGrips>),
}

impl SeedSource {
    /// The atlas, if it is one.
    pub fn atlas(&self) -> Option<&Arc<Atlas>> {
        match self {
            Self::Atlas(atlas) => Some(atlas),
            Self::Nothing | Self::Transferred(_) => None,
        }
    }
}

/// Beside whom grips are to start from, and what they are to be.
#[derive(Clone, Copy, Debug)]
pub struct Demand<'a> {
    /// The receiving hand.
    pub rig: &'a Rig,
    /// The giver and gravity.
    pub presented: &'a Presented,
    /// What is demanded of the grasp.
    pub constraints: &'a Constraints,
    /// Which mechanisms are on.
    pub mechanisms: Mechanisms,
}

/// The grips to start from beside a giver, each kind once it was asked for.
#[derive(Clone, Debug, Default)]
pub struct SeedSets {
    from: SeedSource,
    /// Of an atlas, those that are nearest to keeping clear, …
    nearest: OnceLock<Seeds>,
    /// … or of those that are not certainly in the giver's way.
    open: OnceLock<Seeds>,
    /// Of borrowed ones, those that are promising, …
    passing: OnceLock<(Grips, Seeds)>,
    /// … or of all.
    fitting: OnceLock<(Grips, Seeds)>,
}

impl SeedSets {
    /// No seeds yet: each kind is found on first use.
    pub fn new(from: SeedSource) -> Self {
        Self {
            from,
            ..Self::default()
        }
    }

    /// True if there is nothing to start from.
    pub fn is_empty(&self) -> bool {
        matches!(self.from, SeedSource::Nothing)
    }

    /// Those that an attempt starts from, and the grips that they are of: of an atlas, the ones that hold under this
    /// gravity and are what is demanded, if the giver were not in their way. None if interrupted.
    pub fn of_attempt(
        &self,
        attempt: u64,
        demand: &Demand<'_>,
        interrupted: &impl Fn() -> bool,
    ) -> Option<(&Seeds, &[Entry])> {
        match &self.from {
            SeedSource::Nothing => None,
            SeedSource::Atlas(atlas) => {
                let seeds = self.of_atlas(atlas, attempt, demand, interrupted)?;
                Some((seeds, atlas.entries()))
            }
            SeedSource::Transferred(borrowed) => {
                let (grips, seeds) = self.of_transferred(borrowed, attempt, demand, interrupted)?;
                Some((seeds, grips.entries()))
            }
        }
    }

    fn of_atlas(
        &self,
        atlas: &Atlas,
        attempt: u64,
        demand: &Demand<'_>,
        interrupted: &impl Fn() -> bool,
    ) -> Option<&Seeds> {
        let giver = demand.presented.giver.as_ref();
        let mechanisms = demand.mechanisms;
        let may_be_open = mechanisms.has(Mechanism::OpenSeeds) && mechanisms.has(Mechanism::CellOccupancy);
        let must_be_open = !mechanisms.has(Mechanism::NearestSeeds);
        let from_open_ones =
            may_be_open && (must_be_open || attempt < ATTEMPTS_FROM_OPEN_SEEDS || attempt.is_multiple_of(2));
        let excluding = giver.filter(|_| from_open_ones);
        let seeds = match excluding {
            Some(_) => &self.open,
            None => &self.nearest,
        };
        if let Some(seeds) = seeds.get() {
            return Some(seeds);
        }
        let excluded = excluding.map(|giver| atlas.excluded_by(giver));
        let (holding, unordered) = if mechanisms.has(Mechanism::GravityOrder) {
            (atlas.holding_under(demand.presented.up), 0)
        } else {
            (&[][..], atlas.entries().len() as u16)
        };
        let wanted = holding.iter().copied().chain(0..unordered).filter(|&entry| {
            excluded.as_ref().is_none_or(|excluded| !excluded.contains(entry))
                && atlas.entries()[usize::from(entry)].is_wanted(demand.constraints)
        });
        let found = Seeds::of_with(mechanisms, atlas.grips(), demand.rig, wanted, giver, interrupted)?;
        // Another worker may have found the same meanwhile.
        Some(seeds.get_or_init(|| found))
    }

    /// Every other attempt starts from promising ones. Of the 96 that fit best, these hold more often than others on a scalpel (63 %
    /// against 40) and less often on a remote (20 % against 37), and where one kind finds no way beside a giver, the other
    /// may: of scalpels and scissors held out by 360 recorded givers, two workers answer 94.4 and 95.8 % in 33 ms where all start
    /// from any that fit, and 96.5 and 97.1 so; three of four are no better.
    fn of_transferred(
        &self,
        borrowed: &TransferredGrips,
        attempt: u64,
        demand: &Demand<'_>,
        interrupted: &impl Fn() -> bool,
    ) -> Option<&(Grips, Seeds)> {
        let screens = demand.mechanisms.has(Mechanism::ClosureScreen);
        let (among, seeds) = if screens && attempt.is_multiple_of(2) {
            (Among::Passing, &self.passing)
        } else {
            (Among::All, &self.fitting)
        };
        if let Some(found) = seeds.get() {
            return Some(found);
        }
        let giver = demand.presented.giver.as_ref();
        let grips = borrowed.for_giver(among, demand.rig, giver, demand.constraints, interrupted)?;
        let all = 0..grips.entries().len() as u16;
        let found = Seeds::of_with(demand.mechanisms, &grips, demand.rig, all, giver, interrupted)?;
        Some(seeds.get_or_init(|| (grips, found)))
    }
}
