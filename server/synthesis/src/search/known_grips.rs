//! Known grips as candidates of a race: those of an atlas, those that were found lately, and then those of the atlas without
//! the fingers that the giver is in the way of.

use std::{
    ops::Deref,
    sync::{
        Arc, LazyLock, OnceLock,
        atomic::{AtomicUsize, Ordering},
    },
};

use super::{report::GraspSource, scene::Scene, settings::SearchSettings};
use crate::{
    base::mechanisms::{Mechanism, Mechanisms},
    known::{
        atlas::{Atlas, Excluded, Shortlist},
        entry::Entry,
        recheck::Recheck,
        subset_grasps::spared_with,
    },
    model::{grasp::Grasp, hand::rig::Rig, score::Score, strategy::Choice},
    physical::{
        grip::Gripper,
        solids::{PreparedHand, TrackedSolids},
    },
    rating::scoring::comfort_value,
};

/// Grips that are passed over at most before somebody looks at the clock: one or two microseconds' worth.
const PASSED_AT_ONCE: usize = 64;

/// The order in which an atlas keeps its grips.
static AS_KEPT: LazyLock<Vec<u16>> = LazyLock::new(|| (0..u16::MAX).collect());

/// Known grips in the order in which they are tried.
#[derive(Debug)]
pub(super) struct KnownGrips<'a> {
    atlas: Option<&'a Atlas>,
    /// Those of the atlas that are tried first, one by one, beside a giver: it takes as long to ask which of all are out of
    /// the question.
    shortlist: Shortlist<'a>,
    /// All of the atlas.
    order: &'a [u16],
    /// Those that were found lately. Mostly they are worse than the atlas' own, which were chosen from.
    recent: &'a [Arc<Entry>],
    scene: &'a Scene<'a>,
    asked: Recheck<'a>,
    giver: Option<&'a PreparedHand>,
    /// The front of the order again, for where a giver is in the way of fingers that can be spared.
    sparing: &'a [u16],
    rig: &'a Rig,
    mechanisms: Mechanisms,
    /// Those that certainly meet the giver, once somebody asks.
    excluded: OnceLock<Excluded<'a>>,
    /// The next place that nobody has taken, in the shortlist or, counted on, in the order, among the recent ones or those
    /// that are looked at for sparing fingers.
    next: AtomicUsize,
}

/// The solids of a known grip's hand.
enum Solids<'a> {
    /// Those that the atlas keeps.
    Kept(&'a TrackedSolids),
    /// Made for this look.
    Made(Box<TrackedSolids>),
}

impl Deref for Solids<'_> {
    type Target = TrackedSolids;

    fn deref(&self) -> &TrackedSolids {
        match self {
            Self::Kept(solids) => solids,
            Self::Made(solids) => solids,
        }
    }
}

/// A known grip that may do.
enum Open<'a> {
    /// It may keep clear of the giver.
    Whole {
        source: GraspSource,
        entry: &'a Entry,
        solids: Solids<'a>,
    },
    /// It may hold without the fingers that the giver is in the way of: this grip of the atlas.
    Sparing(u16),
}

/// What was taken of the known grips.
enum Taken<'a> {
    /// There are no more.
    NoneLeft,
    /// Some that certainly meet the giver.
    NoneOpen,
    /// One that may not, and those before it.
    Open(Open<'a>),
}

/// What became of a known grip.
pub(super) enum Tried {
    /// There are no more.
    NoneLeft,
    /// It does not do.
    Refused,
    /// It is a valid grasp.
    Valid {
        /// Where the grip is known from.
        source: GraspSource,
        /// The grasp.
        grasp: Box<Grasp>,
        /// How good it is: more is better.
        value: f32,
    },
}

impl<'a> KnownGrips<'a> {
    /// The grips that a search may use, if any.
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
        let is_any = atlas.is_some() || !recent.is_empty();
        if !is_any || !settings.query.uses_known_grips() {
            return None;
        }
        let giver = presented.giver.as_ref();
        // The shortlist is for givers that are in the way, and the best is not wanted for being on it.
        let shortlist = match (atlas, settings.query.choice) {
            (Some(atlas), Choice::FirstValid) if giver.is_some() && mechanisms.has(Mechanism::Shortlists) => {
                atlas.shortlist(presented.up)
            }
            _ => Shortlist::default(),
        };
        let by_gravity = mechanisms.has(Mechanism::GravityOrder);
        let order = |atlas: &'a Atlas| {
            if by_gravity {
                atlas.by_score(presented.up)
            } else {
                &AS_KEPT[..atlas.entries().len()]
            }
        };
        Some(Self {
            atlas,
            shortlist,
            order: atlas.map_or(&[], order),
            recent,
            scene,
            asked: Recheck::new(object, scene.rig(), presented).with_mechanisms(mechanisms),
            sparing: match (atlas, giver) {
                _ if !mechanisms.has(Mechanism::FingerSubsets) => &[],
                (Some(atlas), Some(_)) if by_gravity => atlas.holding_under(presented.up),
                (Some(atlas), Some(_)) => order(atlas),
                _ => &[],
            },
            giver,
            rig: scene.rig(),
            mechanisms,
            excluded: OnceLock::new(),
            next: AtomicUsize::new(settings.known.tried),
        })
    }

    /// How many were tried or are out of the question, all of those that others are trying included.
    pub(super) fn tried(&self) -> usize {
        self.next.load(Ordering::Relaxed)
    }

    /// How many of the atlas there are.
    pub(super) fn of_atlas(&self) -> usize {
        self.order.len()
    }

    /// Takes the next one that does not certainly meet the giver, if one of the next [`PASSED_AT_ONCE`] is such.
    fn take(&self) -> Taken<'a> {
        let end = self.shortlist.len() + self.order.len() + self.recent.len() + self.sparing.len();
        loop {
            let from = self.next.load(Ordering::Relaxed);
            if from >= end {
                return Taken::NoneLeft;
            }
            let mut to = end.min(from + PASSED_AT_ONCE);
            let mut taken = Taken::NoneOpen;
            let open = (from..to).find_map(|place| Some((place, self.unless_met(place)?)));
            if let Some((place, open)) = open {
                to = place + 1;
                taken = Taken::Open(open);
            }
            // Another worker may have taken the same meanwhile; then they are looked at in vain.
            let exchanged = self
                .next
                .compare_exchange(from, to, Ordering::Relaxed, Ordering::Relaxed);
            if exchanged.is_ok() {
                return taken;
            }
        }
    }

    /// The grip at a place, unless it certainly meets the giver.
    fn unless_met(&self, place: usize) -> Option<Open<'a>> {
        let Some(place) = place.checked_sub(self.shortlist.len()) else {
            let (index, solids) = if self.mechanisms.has(Mechanism::InnerSpheres) {
                self.shortlist.unless_met(place, self.giver?)?
            } else {
                self.shortlist.at(place)
            };
            return self.open(index, Solids::Kept(solids));
        };
        let Some(&index) = self.order.get(place) else {
            return self.beyond_order(place - self.order.len());
        };
        let atlas = self.atlas?;
        let Some(giver) = self.giver else {
            let solids = atlas.entries()[usize::from(index)].tracked_solids(self.rig);
            return self.open(index, Solids::Made(Box::new(solids)));
        };
        if self.mechanisms.has(Mechanism::CellOccupancy) {
            let excluded = self.excluded.get_or_init(|| atlas.excluded_by(giver));
            if excluded.contains(index) {
                return None;
            }
        }
        if !self.mechanisms.has(Mechanism::InnerSpheres) {
            let solids = atlas.entries()[usize::from(index)].tracked_solids(self.rig);
            return self.open(index, Solids::Made(Box::new(solids)));
        }
        let solids = atlas.grips().unless_met(usize::from(index), self.rig, giver)?;
        self.open(index, Solids::Made(solids))
    }

    /// The same of places after those of the order, which few look-ups come to.
    #[inline(never)]
    fn beyond_order(&self, place: usize) -> Option<Open<'a>> {
        let Some(entry) = self.recent.get(place) else {
            let index = self.sparing[place - self.recent.len()];
            let grips = self.atlas?.grips();
            let is_open = !self.mechanisms.has(Mechanism::InnerSpheres)
                || grips.may_hold_with_subset(usize::from(index), self.giver?);
            return is_open.then_some(Open::Sparing(index));
        };
        Some(Open::Whole {
            source: GraspSource::Recent,
            entry,
            solids: Solids::Made(Box::new(entry.tracked_solids(self.rig))),
        })
    }

    /// A whole grip of the atlas.
    fn open(&self, index: u16, solids: Solids<'a>) -> Option<Open<'a>> {
        Some(Open::Whole {
            source: GraspSource::Atlas(index),
            entry: &self.atlas?.entries()[usize::from(index)],
            solids,
        })
    }

    /// Tries the next one.
    pub(super) fn try_next(&self, gripper: &mut Gripper) -> Tried {
        let (source, grasp) = match self.take() {
            Taken::NoneLeft => return Tried::NoneLeft,
            Taken::NoneOpen => return Tried::Refused,
            Taken::Open(Open::Whole {
                source,
                entry,
                solids,
            }) => (source, self.hold(entry, &solids, gripper)),
            Taken::Open(Open::Sparing(index)) => {
                (GraspSource::Spared(index), self.hold_with_subset(index, gripper))
            }
        };
        match grasp {
            Some(grasp) => Tried::Valid {
                source,
                value: value(&grasp),
                grasp,
            },
            None => Tried::Refused,
        }
    }

    fn hold(&self, entry: &Entry, solids: &TrackedSolids, gripper: &mut Gripper) -> Option<Box<Grasp>> {
        let constraints = self.scene.constraints();
        if !entry.is_wanted(constraints) {
            return None;
        }
        let grasp = self.asked.hold(entry, solids, gripper)?;
        constraints.admits(&grasp).then(|| Box::new(grasp))
    }

    /// Apart, as its hands would make room for themselves on the stack of every look-up.
    #[inline(never)]
    fn hold_with_subset(&self, index: u16, gripper: &mut Gripper) -> Option<Box<Grasp>> {
        let entry = &self.atlas?.entries()[usize::from(index)];
        let around = self.scene.surroundings()?;
        spared_with(self.mechanisms, entry, &around, self.giver?, gripper)
    }
}

/// How good a grasp is: its score, or its comfort where it has none.
pub(super) fn value(grasp: &Grasp) -> f32 {
    let score = grasp.score.as_ref();
    score.map_or_else(|| comfort_value(grasp.comfort), Score::total)
}
