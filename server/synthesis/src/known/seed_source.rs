//! The seeds that attempts continue with when a freshly placed hand fails.

use std::sync::{Arc, OnceLock};

use super::{
    atlas::Atlas,
    entry::Entry,
    grips::Grips,
    seeds::Seeds,
    transferred_grips::{Candidates, TransferredGrips},
};
use crate::{
    base::mechanisms::{Mechanism, Mechanisms},
    model::{constraints::Constraints, hand::rig::Rig},
    physical::{
        receiver::{Receiver, SUITABLE},
        scene::Presented,
    },
    propose::proposal::ANYWHERE_EVERY,
};

/// Where seeds come from.
#[derive(Clone, Debug, Default)]
pub enum SeedSource {
    /// Nowhere.
    #[default]
    Nothing,
    /// Known grips of the object.
    Atlas(Arc<Atlas>),
    /// Grips transferred from similar boxes, for an object without an atlas.
    Transferred(Arc<TransferredGrips>),
}

impl SeedSource {
    /// The atlas, if seeds come from one.
    pub fn atlas(&self) -> Option<&Arc<Atlas>> {
        match self {
            Self::Atlas(atlas) => Some(atlas),
            Self::Nothing | Self::Transferred(_) => None,
        }
    }
}

/// What seeds are selected for.
#[derive(Clone, Copy, Debug)]
pub struct SeedContext<'a> {
    /// The receiving hand.
    pub rig: &'a Rig,
    /// The barriers and gravity.
    pub presented: &'a Presented,
    /// The constraints on the grasp.
    pub constraints: &'a Constraints,
    /// The mechanisms that are on.
    pub mechanisms: Mechanisms,
}

/// The seeds for a holdout; each set is computed on first use.
#[derive(Clone, Debug, Default)]
pub struct SeedSets {
    source: SeedSource,
    /// From the whole atlas: the grips nearest to being clear of the barriers, of those whose forearms come from where the
    /// receiver stands, and of all.
    suitable: OnceLock<Seeds>,
    nearest: OnceLock<Seeds>,
    /// From the transferred grips that pass the closure screen.
    passing: OnceLock<(Grips, Seeds)>,
    /// From all transferred grips.
    fitting: OnceLock<(Grips, Seeds)>,
}

impl SeedSets {
    /// No set is computed yet.
    pub fn new(source: SeedSource) -> Self {
        Self {
            source,
            ..Self::default()
        }
    }

    /// True if there are no seeds.
    pub fn is_empty(&self) -> bool {
        matches!(self.source, SeedSource::Nothing)
    }

    /// The seeds of an attempt and the grips they index. Those of an atlas hold under this gravity and meet
    /// the constraints, apart from the barriers. None if interrupted.
    pub fn of_attempt(
        &self,
        attempt: u64,
        context: &SeedContext<'_>,
        interrupted: &impl Fn() -> bool,
    ) -> Option<(&Seeds, &[Entry])> {
        match &self.source {
            SeedSource::Nothing => None,
            SeedSource::Atlas(atlas) => {
                let is_anywhere = attempt.is_multiple_of(ANYWHERE_EVERY);
                let receiver = (!is_anywhere).then_some(&context.presented.receiver);
                let seeds = self.of_atlas(atlas, receiver, context, interrupted)?;
                Some((seeds, atlas.entries()))
            }
            SeedSource::Transferred(transferred) => {
                let (grips, seeds) = self.of_transferred(transferred, attempt, context, interrupted)?;
                Some((seeds, grips.entries()))
            }
        }
    }

    fn of_atlas(
        &self,
        atlas: &Atlas,
        receiver: Option<&Receiver>,
        context: &SeedContext<'_>,
        interrupted: &impl Fn() -> bool,
    ) -> Option<&Seeds> {
        let barriers = context.presented.barriers();
        let mechanisms = context.mechanisms;
        let receiver = receiver.filter(|receiver| receiver.is_expected());
        let set = if receiver.is_some() {
            &self.suitable
        } else {
            &self.nearest
        };
        if let Some(seeds) = set.get() {
            return Some(seeds);
        }
        let forearms = atlas.grips().forearms();
        let suits = |entry: u16| {
            receiver.is_none_or(|receiver| receiver.suits_forearm(forearms[usize::from(entry)]) >= SUITABLE)
        };
        let (holding, unordered) = if mechanisms.has(Mechanism::GravityOrder) {
            (atlas.holding_under(context.presented.up), 0)
        } else {
            (&[][..], atlas.entries().len() as u16)
        };
        let candidates =
            holding.iter().copied().chain(0..unordered).filter(|&entry| {
                suits(entry) && atlas.entries()[usize::from(entry)].meets(context.constraints)
            });
        let new_seeds = Seeds::of_with(
            mechanisms,
            atlas.grips(),
            context.rig,
            candidates,
            barriers,
            interrupted,
        )?;
        // Another worker may have computed the same set meanwhile.
        Some(set.get_or_init(|| new_seeds))
    }

    /// Alternates between grips that pass the closure screen and all that fit. Passing grips hold more often
    /// on some objects and less often on others, and where one kind finds nothing next to a giver, the other
    /// may.
    fn of_transferred(
        &self,
        transferred: &TransferredGrips,
        attempt: u64,
        context: &SeedContext<'_>,
        interrupted: &impl Fn() -> bool,
    ) -> Option<&(Grips, Seeds)> {
        let screens = context.mechanisms.has(Mechanism::ClosureScreen);
        let (candidates, seeds) = if screens && attempt.is_multiple_of(2) {
            (Candidates::Passing, &self.passing)
        } else {
            (Candidates::All, &self.fitting)
        };
        if let Some(new_seeds) = seeds.get() {
            return Some(new_seeds);
        }
        let barriers = context.presented.barriers();
        let grips = transferred.away_from(
            candidates,
            context.rig,
            barriers,
            context.constraints,
            interrupted,
        )?;
        let all = 0..grips.entries().len() as u16;
        let new_seeds = Seeds::of_with(
            context.mechanisms,
            &grips,
            context.rig,
            all,
            barriers,
            interrupted,
        )?;
        Some(seeds.get_or_init(|| (grips, new_seeds)))
    }
}
