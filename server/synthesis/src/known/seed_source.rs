//! The seeds that attempts continue with when a freshly placed hand fails.

use std::sync::{Arc, OnceLock};

use super::{
    atlas::Atlas,
    entry::Entry,
    grips::Grips,
    resized_grips::ResizedGrips,
    seeds::Seeds,
    transferred_grips::{Candidates, TransferredGrips},
};
use crate::{
    model::{hand::rig::Rig, requirements::Requirements},
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
    /// Known grips of the object at another size.
    Resized(ResizedGrips),
}

impl SeedSource {
    /// The atlas, if seeds come from one.
    pub fn atlas(&self) -> Option<&Arc<Atlas>> {
        match self {
            Self::Atlas(atlas) => Some(atlas),
            Self::Resized(grips) => Some(grips.atlas()),
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
    /// The requirements on the grasp.
    pub requirements: &'a Requirements,
}

/// The seeds for a holdout; each set is computed on first use.
#[derive(Clone, Debug, Default)]
pub struct SeedSets {
    source: SeedSource,
    /// From the whole atlas: the grips nearest to being clear of the barriers, of those whose forearms come from where the
    /// receiver stands, and of all.
    suitable: OnceLock<Seeds>,
    nearest: OnceLock<Seeds>,
    /// From grips that are moved to the object: of transferred ones, those that pass the closure screen; of resized ones,
    /// those whose forearms come from where the receiver stands.
    preferred: OnceLock<(Grips, Seeds)>,
    /// From all of them.
    moved: OnceLock<(Grips, Seeds)>,
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
    /// the requirements, apart from the barriers. None if interrupted.
    pub fn of_attempt(
        &self,
        attempt: u64,
        context: &SeedContext<'_>,
        interrupted: &impl Fn() -> bool,
    ) -> Option<(&Seeds, &[Entry])> {
        match &self.source {
            SeedSource::Nothing => None,
            SeedSource::Atlas(atlas) => {
                let receiver = expected_receiver(attempt, context);
                let seeds = self.of_atlas(atlas, receiver, context, interrupted)?;
                Some((seeds, atlas.entries()))
            }
            SeedSource::Resized(resized) => {
                let (grips, seeds) = self.of_resized(resized, attempt, context, interrupted)?;
                Some((seeds, grips.entries()))
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
        let set = if receiver.is_some() {
            &self.suitable
        } else {
            &self.nearest
        };
        if let Some(seeds) = set.get() {
            return Some(seeds);
        }
        let candidates = candidates(atlas, receiver, context)
            .filter(|&entry| atlas.entries()[usize::from(entry)].meets(context.requirements));
        let new_seeds = Seeds::of(atlas.grips(), context.rig, candidates, barriers, interrupted)?;
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
        let (candidates, seeds) = if attempt.is_multiple_of(2) {
            (Candidates::Passing, &self.preferred)
        } else {
            (Candidates::All, &self.moved)
        };
        if let Some(new_seeds) = seeds.get() {
            return Some(new_seeds);
        }
        let barriers = context.presented.barriers();
        let grips = transferred.away_from(
            candidates,
            context.rig,
            barriers,
            context.requirements,
            interrupted,
        )?;
        let new_seeds = of_all(&grips, context, interrupted)?;
        Some(seeds.get_or_init(|| (grips, new_seeds)))
    }

    fn of_resized(
        &self,
        resized: &ResizedGrips,
        attempt: u64,
        context: &SeedContext<'_>,
        interrupted: &impl Fn() -> bool,
    ) -> Option<&(Grips, Seeds)> {
        let receiver = expected_receiver(attempt, context);
        let seeds = if receiver.is_some() {
            &self.preferred
        } else {
            &self.moved
        };
        if let Some(new_seeds) = seeds.get() {
            return Some(new_seeds);
        }
        let grips = resized.away_from(
            candidates(resized.atlas(), receiver, context),
            context.rig,
            context.presented.barriers(),
            context.requirements,
            interrupted,
        )?;
        let new_seeds = of_all(&grips, context, interrupted)?;
        Some(seeds.get_or_init(|| (grips, new_seeds)))
    }
}

/// The receiver that an attempt's seeds should suit, if one is expected; some attempts take any.
fn expected_receiver<'a>(attempt: u64, context: &SeedContext<'a>) -> Option<&'a Receiver> {
    let receiver = &context.presented.receiver;
    (!attempt.is_multiple_of(ANYWHERE_EVERY) && receiver.is_expected()).then_some(receiver)
}

/// The entries of an atlas that hold under this gravity, by falling score, and suit the receiver, if one is given.
fn candidates<'a>(
    atlas: &'a Atlas,
    receiver: Option<&'a Receiver>,
    context: &SeedContext<'_>,
) -> impl Iterator<Item = u16> + 'a {
    let forearms = atlas.grips().forearms();
    let holding = atlas.holding_under(context.presented.up);
    holding.into_iter().filter(move |&entry| {
        receiver.is_none_or(|receiver| receiver.suits_forearm(forearms[usize::from(entry)]) >= SUITABLE)
    })
}

/// Seeds from all grips, which were selected for the holdout.
fn of_all(grips: &Grips, context: &SeedContext<'_>, interrupted: &impl Fn() -> bool) -> Option<Seeds> {
    Seeds::of(
        grips,
        context.rig,
        0..grips.entries().len() as u16,
        context.presented.barriers(),
        interrupted,
    )
}
