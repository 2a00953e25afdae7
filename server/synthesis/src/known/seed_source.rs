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
    base::stop::{Stop, Stopped},
    model::{hand::rig::Rig, requirements::Requirements},
    physical::{barriers::Barriers, presented::Presented, receiver::SUITABLE},
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
            Self::Resized(grips) => Some(&grips.atlas),
            Self::Nothing | Self::Transferred(_) => None,
        }
    }

    /// Whether an attempt's seeds come from the grips that are more likely to do: those whose forearms come from where the
    /// receiver stands or, of transferred ones, those that pass the closure screen. The others may do where these find nothing.
    fn prefers(&self, attempt: u64, context: &SeedContext<'_>) -> bool {
        match self {
            Self::Nothing => false,
            Self::Transferred(_) => attempt.is_multiple_of(2),
            Self::Atlas(_) | Self::Resized(_) => {
                !attempt.is_multiple_of(ANYWHERE_EVERY) && context.presented.receiver.is_expected()
            }
        }
    }

    fn select(&self, prefers: bool, context: &SeedContext<'_>, stop: Stop<'_>) -> Result<SeedSet, Stopped> {
        let SeedContext {
            rig,
            presented,
            requirements,
        } = *context;
        let barriers = presented.barriers();
        let moved = match self {
            Self::Nothing => Grips::default(),
            Self::Atlas(atlas) => {
                let meets = |entry: &u16| atlas.entries()[usize::from(*entry)].meets(requirements);
                let candidates = candidates(atlas, prefers, presented).filter(meets);
                let seeds = Seeds::of(atlas.grips(), rig, candidates, barriers, stop)?;
                return Ok(SeedSet { moved: None, seeds });
            }
            Self::Resized(resized) => {
                let candidates = candidates(&resized.atlas, prefers, presented);
                resized.away_from(candidates, rig, barriers, requirements, stop)?
            }
            Self::Transferred(transferred) => {
                let candidates = if prefers {
                    Candidates::Passing
                } else {
                    Candidates::All
                };
                transferred.away_from(candidates, rig, barriers, requirements, stop)?
            }
        };
        let all = 0..moved.entries().len() as u16;
        let seeds = Seeds::of(&moved, rig, all, barriers, stop)?;
        let moved = Some(moved);
        Ok(SeedSet { moved, seeds })
    }
}

/// The entries of an atlas that hold under this gravity, by falling score, and suit the receiver, if they are to.
fn candidates<'a>(
    atlas: &'a Atlas,
    suit_receiver: bool,
    presented: &'a Presented,
) -> impl Iterator<Item = u16> + 'a {
    let holding = atlas.holding_under(presented.up).into_iter();
    holding.filter(move |&entry| {
        let forearm = atlas.grips().forearms()[usize::from(entry)];
        !suit_receiver || presented.receiver.suits_forearm(forearm) >= SUITABLE
    })
}

/// An atlas of an object that is held out at another size or is of another mass. Its grips are known to hold the object as it was.
#[derive(Clone, Debug)]
pub struct ResizedGrips {
    atlas: Arc<Atlas>,
    scale: f32,
}

impl ResizedGrips {
    /// Grips for an object that is `scale` times as large as that of the atlas.
    pub fn new(atlas: Arc<Atlas>, scale: f32) -> Self {
        Self { atlas, scale }
    }

    /// The grips of some entries of the atlas that meet the requirements and are farthest from the barriers, on the object at
    /// its new size; the first entries win ties. `rig` is the hand that the grips were made for.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn away_from(
        &self,
        entries: impl Iterator<Item = u16>,
        rig: &Rig,
        barriers: Barriers<'_>,
        requirements: &Requirements,
        stop: Stop<'_>,
    ) -> Result<Grips, Stopped> {
        let entry = |index: u16| &self.atlas.entries()[usize::from(index)];
        let clearance = |index: u16| {
            let way = entry(index).way_on_resized(self.scale);
            let grips = self.atlas.grips();
            grips.moved_clearance_upper_bound(usize::from(index), way, barriers)
        };
        let resized = |index: u16| -> Entry { entry(index).on_resized(self.scale) };
        Grips::farthest(rig, entries, clearance, resized, (barriers, requirements), stop)
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

/// Seeds and the grips that they index, unless these are an atlas'.
#[derive(Clone, Debug)]
struct SeedSet {
    moved: Option<Grips>,
    seeds: Seeds,
}

/// The seeds for a holdout: from all grips, and from preferred ones, each computed on first use.
#[derive(Clone, Debug, Default)]
pub struct SeedSets {
    source: SeedSource,
    sets: [OnceLock<SeedSet>; 2],
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
    /// the requirements, apart from the barriers.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of_attempt(
        &self,
        attempt: u64,
        context: &SeedContext<'_>,
        stop: Stop<'_>,
    ) -> Result<(&Seeds, &[Entry]), Stopped> {
        let prefers = self.source.prefers(attempt, context);
        let place = &self.sets[usize::from(prefers)];
        let set = if let Some(set) = place.get() {
            set
        } else {
            let selected = self.source.select(prefers, context, stop)?;
            // Another worker may have computed the same set meanwhile.
            place.get_or_init(|| selected)
        };
        let of_atlas = || self.source.atlas().map_or(&[][..], |atlas| atlas.entries());
        let entries = set.moved.as_ref().map_or_else(of_atlas, Grips::entries);
        Ok((&set.seeds, entries))
    }
}
