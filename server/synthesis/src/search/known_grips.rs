//! Known grips as candidates of a race: those of the atlas, then recent ones.
//!
//! Where a receiver is expected to stand, a search for the first valid grasp takes those whose forearms come from there first:
//! of the shortlist, then of the whole atlas. Only if none is valid, it takes another.

use std::{
    ops::Deref,
    sync::{
        Arc, LazyLock, OnceLock,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
};

use glam::Vec3;

use super::{report::GraspSource, scene::Scene, settings::SearchSettings};
use crate::{
    base::mechanisms::{Mechanism, Mechanisms},
    known::{
        atlas::{Atlas, Excluded, Shortlist},
        entry::Entry,
        recheck::GripChecker,
    },
    model::{grasp::Grasp, hand::rig::Rig, score::Score, strategy::Choice},
    physical::{
        barriers::Barriers,
        grip::Gripper,
        receiver::{Receiver, SUITABLE},
        solids::TrackedSolids,
    },
    rating::scoring::comfort_value,
};

/// Grips skipped between two clock checks: one or two microseconds of work.
const GRIPS_PER_CLOCK_CHECK: usize = 64;

/// The indices of an atlas' entries in their stored order.
static STORED_ORDER: LazyLock<Vec<u16>> = LazyLock::new(|| (0..u16::MAX).collect());

/// Known grips in the order in which they are tried.
#[derive(Debug)]
pub(super) struct KnownGrips<'a> {
    atlas: Option<&'a Atlas>,
    /// The atlas' shortlist for givers. These are screened one by one, because excluding grips of the whole
    /// atlas at once takes as long.
    shortlist: Shortlist<'a>,
    /// Its places in the order in which they are tried.
    listed: Vec<u16>,
    /// All grips of the atlas.
    order: &'a [u16],
    /// Where the receiver stands, if the order follows that. All grips are then passed twice: those whose forearms suit it, then
    /// the others.
    receiver: Option<&'a Receiver>,
    /// True once a grip is valid whose forearm does not suit where the receiver stands.
    has_fallback: AtomicBool,
    /// Recent grips. Mostly they are worse than those of the atlas, which are a selection.
    recent: &'a [Arc<Entry>],
    scene: &'a Scene<'a>,
    checker: GripChecker<'a>,
    barriers: Barriers<'a>,
    rig: &'a Rig,
    mechanisms: Mechanisms,
    /// Grips that certainly collide with the giver, computed on first use.
    excluded: OnceLock<Excluded<'a>>,
    /// The next place to try, counted through `listed`, `order` once or twice, and `recent`.
    cursor: AtomicUsize,
}

/// The solids of a known grip's hand.
enum Solids<'a> {
    /// Stored with the atlas.
    Stored(&'a TrackedSolids),
    /// Computed for this grip.
    Computed(Box<TrackedSolids>),
}

impl Deref for Solids<'_> {
    type Target = TrackedSolids;

    fn deref(&self) -> &TrackedSolids {
        match self {
            Self::Stored(solids) => solids,
            Self::Computed(solids) => solids,
        }
    }
}

/// A known grip that may be clear of the barriers.
struct Candidate<'a> {
    source: GraspSource,
    entry: &'a Entry,
    solids: Solids<'a>,
}

/// The result of advancing through the known grips.
enum Next<'a> {
    /// All have been tried.
    Exhausted,
    /// The grips just passed certainly collide with a barrier.
    AllExcluded,
    /// A grip to check; those passed before it certainly collide.
    Candidate(Candidate<'a>),
}

/// The result of trying a known grip.
pub(super) enum TryResult {
    /// All have been tried.
    Exhausted,
    /// It is not valid.
    Rejected,
    /// It is a valid grasp.
    Valid {
        /// Where the grip comes from.
        source: GraspSource,
        /// The grasp.
        grasp: Box<Grasp>,
        /// Its quality; higher is better.
        value: f32,
        /// Whether its forearm suits where the receiver stands, if that is asked.
        suits: bool,
    },
}

impl<'a> KnownGrips<'a> {
    /// The known grips that a search may use; none if there are none.
    pub(super) fn of(scene: &'a Scene<'a>, settings: &'a SearchSettings) -> Option<Self> {
        let (object, presented) = scene.physical()?;
        let mechanisms = settings.run.mechanisms;
        let atlas = settings.known.atlas.as_deref();
        let atlas = atlas.filter(|_| mechanisms.has(Mechanism::AtlasLookUp));
        let recent = if settings.run.reproducible || !mechanisms.has(Mechanism::RecentGrips) {
            &[]
        } else {
            settings.known.recent.entries()
        };
        let has_any = atlas.is_some() || !recent.is_empty();
        if !has_any || !settings.query.uses_known_grips() {
            return None;
        }
        let barriers = presented.barriers();
        let is_first_valid = settings.query.choice == Choice::FirstValid;
        let receiver = Some(&presented.receiver).filter(|receiver| is_first_valid && receiver.is_expected());
        // The shortlist serves searches with barriers that any valid grasp ends; it is no better than the rest.
        let is_listed = is_first_valid && (!barriers.is_empty() || receiver.is_some());
        let shortlist = match atlas {
            Some(atlas) if is_listed && mechanisms.has(Mechanism::Shortlists) => {
                atlas.shortlist(presented.up)
            }
            _ => Shortlist::default(),
        };
        let by_gravity = mechanisms.has(Mechanism::GravityOrder);
        let order = |atlas: &'a Atlas| {
            if by_gravity {
                atlas.by_score(presented.up)
            } else {
                &STORED_ORDER[..atlas.entries().len()]
            }
        };
        Some(Self {
            atlas,
            listed: shortlist.by_value(|forearm| presented.receiver.suits_forearm(forearm)),
            shortlist,
            receiver,
            has_fallback: AtomicBool::new(false),
            order: atlas.map_or(&[], order),
            recent,
            scene,
            checker: GripChecker::new(object, scene.rig(), presented).with_mechanisms(mechanisms),
            barriers,
            rig: scene.rig(),
            mechanisms,
            excluded: OnceLock::new(),
            cursor: AtomicUsize::new(settings.known.tried),
        })
    }

    /// How many have been tried or excluded, including those that other workers are trying.
    pub(super) fn tried(&self) -> usize {
        self.cursor.load(Ordering::Relaxed)
    }

    /// The number of grips in the atlas.
    pub(super) fn atlas_len(&self) -> usize {
        self.order.len()
    }

    /// Advances to the next grip that does not certainly collide with a barrier, past at most
    /// [`GRIPS_PER_CLOCK_CHECK`] grips.
    fn next(&self) -> Next<'a> {
        let passes = 1 + usize::from(self.receiver.is_some());
        let end = self.listed.len() + passes * self.order.len() + self.recent.len();
        let at_once = self.barriers.comparisons_per_check(GRIPS_PER_CLOCK_CHECK);
        loop {
            let from = self.cursor.load(Ordering::Relaxed);
            if from >= end {
                return Next::Exhausted;
            }
            let mut to = end.min(from + at_once);
            let mut next = Next::AllExcluded;
            let candidate = (from..to).find_map(|place| Some((place, self.candidate_at(place)?)));
            if let Some((place, found)) = candidate {
                to = place + 1;
                next = Next::Candidate(found);
            }
            // If another worker took the same grips meanwhile, this result is dropped.
            let exchanged = self
                .cursor
                .compare_exchange(from, to, Ordering::Relaxed, Ordering::Relaxed);
            if exchanged.is_ok() {
                return next;
            }
        }
    }

    /// The grip at a place, unless it certainly collides with a barrier.
    fn candidate_at(&self, place: usize) -> Option<Candidate<'a>> {
        let Some(place) = place.checked_sub(self.listed.len()) else {
            let place = usize::from(self.listed[place]);
            let (index, solids) = if self.mechanisms.has(Mechanism::InnerSpheres) {
                self.shortlist.screen(place, self.barriers)?
            } else {
                self.shortlist.at(place)
            };
            return self.of_atlas(index, Solids::Stored(solids));
        };
        // With a grip to fall back on, only suitable ones are worth trying.
        let passes_twice = self.receiver.is_some();
        if place >= self.order.len() && passes_twice && self.has_fallback.load(Ordering::Relaxed) {
            return None;
        }
        let (index, is_second) = match self.order.get(place) {
            Some(&index) => (index, false),
            None if passes_twice && place < 2 * self.order.len() => {
                (self.order[place - self.order.len()], true)
            }
            None => {
                let passed = self.order.len() * (1 + usize::from(passes_twice));
                return Some(self.recent_at(place - passed));
            }
        };
        let atlas = self.atlas?;
        if let Some(receiver) = self.receiver
            && suits(receiver, atlas.grips().forearms()[usize::from(index)]) == is_second
        {
            return None;
        }
        if let Some(giver) = self.barriers.giver
            && self.mechanisms.has(Mechanism::CellOccupancy)
        {
            let excluded = self.excluded.get_or_init(|| atlas.excluded_by(giver));
            if excluded.contains(index) {
                return None;
            }
        }
        if self.barriers.is_empty() || !self.mechanisms.has(Mechanism::InnerSpheres) {
            let solids = atlas.entries()[usize::from(index)].tracked_solids(self.rig);
            return self.of_atlas(index, Solids::Computed(Box::new(solids)));
        }
        let solids = atlas
            .grips()
            .screen(usize::from(index), self.rig, self.barriers)?;
        self.of_atlas(index, Solids::Computed(solids))
    }

    /// A recent grip, which few look-ups reach.
    #[inline(never)]
    fn recent_at(&self, index: usize) -> Candidate<'a> {
        let entry = &self.recent[index];
        Candidate {
            source: GraspSource::Recent,
            entry,
            solids: Solids::Computed(Box::new(entry.tracked_solids(self.rig))),
        }
    }

    /// A grip of the atlas.
    fn of_atlas(&self, index: u16, solids: Solids<'a>) -> Option<Candidate<'a>> {
        Some(Candidate {
            source: GraspSource::Atlas(index),
            entry: &self.atlas?.entries()[usize::from(index)],
            solids,
        })
    }

    /// Tries the next grip.
    pub(super) fn try_next(&self, gripper: &mut Gripper) -> TryResult {
        let Candidate {
            source,
            entry,
            solids,
        } = match self.next() {
            Next::Exhausted => return TryResult::Exhausted,
            Next::AllExcluded => return TryResult::Rejected,
            Next::Candidate(candidate) => candidate,
        };
        match self.recheck(entry, &solids, gripper) {
            Some(grasp) => {
                let suits = self
                    .receiver
                    .is_none_or(|receiver| suits(receiver, entry.forearm()));
                if !suits {
                    self.has_fallback.store(true, Ordering::Relaxed);
                }
                TryResult::Valid {
                    source,
                    value: grasp_value(&grasp),
                    grasp,
                    suits,
                }
            }
            None => TryResult::Rejected,
        }
    }

    fn recheck(&self, entry: &Entry, solids: &TrackedSolids, gripper: &mut Gripper) -> Option<Box<Grasp>> {
        let constraints = self.scene.constraints();
        if !entry.meets(constraints) {
            return None;
        }
        let grasp = self.checker.check(entry, solids, gripper)?;
        constraints.admits(&grasp).then(|| Box::new(grasp))
    }
}

/// True if a forearm suits where the receiver stands.
fn suits(receiver: &Receiver, forearm: Vec3) -> bool {
    receiver.suits_forearm(forearm) >= SUITABLE
}

/// The quality of a grasp: its score, or its comfort if it has none; for two hands, their mean.
pub(super) fn grasp_value(grasp: &Grasp) -> f32 {
    let score = grasp.score.as_ref();
    let value = score.map_or_else(|| comfort_value(grasp.comfort), Score::total);
    let other = grasp.other_hand.as_deref();
    other.map_or(value, |other| 0.5 * (value + grasp_value(other)))
}
