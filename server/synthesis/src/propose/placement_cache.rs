//! Placements at which a hand fits at an object, whoever presents it: sampled once per object and rig.

use std::{
    fmt,
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use glam::{Quat, Vec3};

use super::{
    prepared::{PreparedObject, PreparedRig},
    proposal::{Candidate, ProposalContext},
    success_prior::ObjectFeatures,
    surface_pairs::SurfacePair,
};
use crate::{
    base::{
        pose::Pose,
        random::AttemptStream,
        stop::{Stop, Stopped, unstopped},
    },
    physical::barriers::Barriers,
};

/// Number of leading attempts of a search that choose from the cache, each from its own row. Most searches end within them;
/// later attempts sample freely, so that the cache does not limit what they can find.
pub const ROWS: u64 = 32;

/// Candidates sampled per row. More let a row be choosier, and take longer to build.
const SAMPLED: usize = 512;

/// Largest number of placements kept per row. More leave more that are clear of a giver, and take longer to choose from.
const KEPT: usize = 24;

/// Exponent of the success prior when filling a row. Choosing from a row applies the prior again, with the giver known.
const PREFERENCE: f32 = 1.0;

/// Seed of the samples: arbitrary, but fixed so that an object always has the same placements.
const SEED: u64 = 0x5245_5045;

/// Largest number of caches per object: one each for the left and right hands of the built-in rigs.
const MAX_RIGS: usize = 4;

/// A hand that fits at the object, in a form that wastes no bytes on alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CachedPlacement {
    /// The index of its opposition among the rig's.
    opposition: u16,
    pair: SurfacePair,
    position: Vec3,
    orientation: [f32; 4],
}

impl CachedPlacement {
    fn of(candidate: &Candidate<'_>) -> Self {
        let Pose {
            position,
            orientation,
        } = candidate.object_from_wrist;
        Self {
            opposition: candidate.opposition.index,
            pair: candidate.pair,
            position,
            orientation: orientation.to_array(),
        }
    }

    fn object_from_wrist(&self) -> Pose {
        Pose {
            position: self.position,
            orientation: Quat::from_array(self.orientation),
        }
    }
}

/// The placements at which a rig's hand fits at an object and is likely to hold it, whoever presents it.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacementCache {
    rows: Vec<Vec<CachedPlacement>>,
}

impl PlacementCache {
    /// Samples the placements: about five milliseconds. `None` for a crowded surface.
    pub fn of(object: &PreparedObject, rig: &PreparedRig) -> Self {
        unstopped(|stop| Self::of_until(object, rig, stop))
    }

    fn of_until(object: &PreparedObject, rig: &PreparedRig, stop: Stop<'_>) -> Result<Self, Stopped> {
        let context = ProposalContext {
            object,
            surface: object.surface_pairs(),
            barriers: Barriers::NONE,
            chooses: None,
            rig,
            placements: None,
        };
        // Searches sample freely what would take seconds to find here.
        let rows = if object.surface.is_crowded() { 0 } else { ROWS };
        let features = ObjectFeatures::of(object);
        let row = |row| {
            stop.check()?;
            let mut stream = AttemptStream::new(SEED, row);
            let sampled = context.sample_candidates(SAMPLED, &mut stream);
            let ordered = context.order_by_success_prior(&features, PREFERENCE, sampled, &mut stream);
            let fitting = ordered.iter().filter(|candidate| context.fits(candidate));
            let kept = fitting.take(KEPT).map(CachedPlacement::of);
            let mut kept: Vec<CachedPlacement> = kept.collect();
            kept.shrink_to_fit();
            Ok(kept)
        };
        Ok(Self {
            rows: (0..rows).map(row).collect::<Result<_, Stopped>>()?,
        })
    }

    /// The candidates for an attempt; none from attempt [`ROWS`] on. `rig` must be the one the cache was built for.
    pub fn row<'a>(&'a self, attempt: u64, rig: &'a PreparedRig) -> impl Iterator<Item = Candidate<'a>> {
        let row = usize::try_from(attempt).ok().and_then(|row| self.rows.get(row));
        row.into_iter().flatten().map(|placement| Candidate {
            opposition: rig.oppositions().get(placement.opposition),
            pair: placement.pair,
            object_from_wrist: placement.object_from_wrist(),
        })
    }
}

/// An object's placement caches, one per rig, each built on first use. Clones share them.
#[derive(Clone, Default)]
pub struct PlacementCaches(Arc<Mutex<Vec<CacheSlot>>>);

/// A rig and its cache once it is built.
type CacheSlot = (PreparedRig, Arc<OnceLock<Arc<PlacementCache>>>);

impl PlacementCaches {
    /// Upper bound on the size of one cache, in bytes.
    pub const BYTES_PER_RIG: usize = ROWS as usize * KEPT * size_of::<CachedPlacement>();

    /// The cache of a rig, built on first use. Beyond [`MAX_RIGS`], the oldest is evicted.
    pub(super) fn of(&self, object: &PreparedObject, rig: &PreparedRig) -> Arc<PlacementCache> {
        // Built outside the lock, so that searches with other hands are not blocked.
        let slot = self.slot(rig);
        Arc::clone(slot.get_or_init(|| Arc::new(PlacementCache::of(object, rig))))
    }

    /// Builds the cache of a rig unless it has one, and unless it is stopped. While it is built, others may build it, too.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn build_until(
        &self,
        object: &PreparedObject,
        rig: &PreparedRig,
        stop: Stop<'_>,
    ) -> Result<(), Stopped> {
        let slot = self.slot(rig);
        if slot.get().is_none() {
            let cache = PlacementCache::of_until(object, rig, stop)?;
            slot.get_or_init(|| Arc::new(cache));
        }
        Ok(())
    }

    /// True if the cache of a rig is built.
    pub(super) fn has(&self, rig: &PreparedRig) -> bool {
        self.slot(rig).get().is_some()
    }

    /// The place of the cache of a rig.
    fn slot(&self, rig: &PreparedRig) -> Arc<OnceLock<Arc<PlacementCache>>> {
        let mut slots = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, slot)) = slots.iter().find(|(slot_rig, _)| slot_rig == rig) {
            return Arc::clone(slot);
        }
        if slots.len() == MAX_RIGS {
            slots.remove(0);
        }
        let slot = Arc::default();
        slots.push((rig.clone(), Arc::clone(&slot)));
        slot
    }
}

impl fmt::Debug for PlacementCaches {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PlacementCaches").finish_non_exhaustive()
    }
}
