//! The grips of an atlas as candidates of a race.

use std::{
    ops::Deref,
    sync::{
        OnceLock,
        atomic::{AtomicUsize, Ordering},
    },
};

use super::SearchSettings;
use crate::{
    atlas::{Atlas, Excluded, Shortlist, asked::Asked},
    grasp::Grasp,
    hand::rig::Rig,
    physical::{
        grip::Gripper,
        solids::{PreparedHand, ToldSolids},
    },
    score::{Score, comfort_value},
    strategy::Choice,
    synthesis::scene::Scene,
};

/// Grips that are passed over at most before somebody looks at the clock: one or two microseconds' worth.
const PASSED_AT_ONCE: usize = 64;

/// The grips of an atlas in the order in which they are tried.
#[derive(Debug)]
pub(super) struct KnownGrips<'a> {
    atlas: &'a Atlas,
    /// Those that are tried first, one by one, beside a giver: it takes as long to ask which of all are out of the question.
    shortlist: Shortlist<'a>,
    /// All of them.
    order: &'a [u16],
    scene: &'a Scene<'a>,
    asked: Asked<'a>,
    giver: Option<&'a PreparedHand>,
    rig: &'a Rig,
    /// Those that certainly meet the giver, once somebody asks.
    excluded: OnceLock<Excluded<'a>>,
    /// The next place that nobody has taken, in the shortlist or, counted on, in the order.
    next: AtomicUsize,
}

/// The solids of a known grip's hand.
enum Solids<'a> {
    /// Those that the atlas keeps.
    Kept(&'a ToldSolids),
    /// Made for this look.
    Made(Box<ToldSolids>),
}

impl Deref for Solids<'_> {
    type Target = ToldSolids;

    fn deref(&self) -> &ToldSolids {
        match self {
            Self::Kept(solids) => solids,
            Self::Made(solids) => solids,
        }
    }
}

/// What was taken of the known grips.
enum Taken<'a> {
    /// There are no more.
    NoneLeft,
    /// Some that certainly meet the giver.
    NoneOpen,
    /// One that may not, an index of the atlas with its solids, and those before it.
    Open(u16, Solids<'a>),
}

/// What became of a known grip.
pub(super) enum Tried {
    /// There are no more.
    NoneLeft,
    /// It does not do.
    Refused,
    /// It is a valid grasp.
    Valid {
        /// The grip's index in the atlas.
        entry: u16,
        /// The grasp.
        grasp: Box<Grasp>,
        /// How good it is: more is better.
        value: f32,
    },
}

impl<'a> KnownGrips<'a> {
    /// The grips that a search may use, if any.
    pub(super) fn of(scene: &'a Scene<'a>, settings: &'a SearchSettings) -> Option<Self> {
        let atlas = settings.atlas.as_deref()?;
        let (object, presented) = scene.physical()?;
        if !super::uses_atlas(settings.strategy, settings.validity) {
            return None;
        }
        let giver = presented.giver.as_ref();
        // The shortlist is for givers that are in the way, and the best is not wanted for being on it.
        let shortlist = match settings.choice {
            Choice::FirstValid if giver.is_some() => atlas.shortlist(presented.up),
            _ => Shortlist::default(),
        };
        Some(Self {
            atlas,
            shortlist,
            order: atlas.by_score(presented.up),
            scene,
            asked: Asked::new(object, scene.rig(), presented),
            giver,
            rig: scene.rig(),
            excluded: OnceLock::new(),
            next: AtomicUsize::new(0),
        })
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.order.len()
    }

    /// Takes the next one that does not certainly meet the giver, if one of the next [`PASSED_AT_ONCE`] is such.
    fn take(&self) -> Taken<'a> {
        let end = self.shortlist.len() + self.order.len();
        loop {
            let from = self.next.load(Ordering::Relaxed);
            if from >= end {
                return Taken::NoneLeft;
            }
            let mut to = end.min(from + PASSED_AT_ONCE);
            let mut taken = Taken::NoneOpen;
            if let Some((place, entry, solids)) = (from..to).find_map(|place| self.unless_met(place)) {
                to = place + 1;
                taken = Taken::Open(entry, solids);
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

    /// A place with the grip there and its solids, unless it certainly meets the giver.
    fn unless_met(&self, place: usize) -> Option<(usize, u16, Solids<'a>)> {
        let Some(giver) = self.giver else {
            let entry = self.order[place];
            let solids = self.atlas.entries()[usize::from(entry)].told_solids(self.rig);
            return Some((place, entry, Solids::Made(Box::new(solids))));
        };
        let Some(in_order) = place.checked_sub(self.shortlist.len()) else {
            let (entry, solids) = self.shortlist.unless_met(place, giver)?;
            return Some((place, entry, Solids::Kept(solids)));
        };
        let entry = self.order[in_order];
        let excluded = self.excluded.get_or_init(|| self.atlas.excluded_by(giver));
        if excluded.contains(entry) {
            return None;
        }
        let solids = self
            .atlas
            .grips()
            .unless_met(usize::from(entry), self.rig, giver)?;
        Some((place, entry, Solids::Made(solids)))
    }

    /// Tries the next one.
    pub(super) fn try_next(&self, gripper: &mut Gripper) -> Tried {
        let (entry, solids) = match self.take() {
            Taken::NoneLeft => return Tried::NoneLeft,
            Taken::NoneOpen => return Tried::Refused,
            Taken::Open(entry, solids) => (entry, solids),
        };
        let grip = &self.atlas.entries()[usize::from(entry)];
        let constraints = self.scene.constraints();
        if !grip.is_wanted(constraints) {
            return Tried::Refused;
        }
        match self.asked.hold(grip, &solids, gripper) {
            Some(grasp) if constraints.admits(&grasp) => Tried::Valid {
                entry,
                value: value(&grasp),
                grasp: Box::new(grasp),
            },
            _ => Tried::Refused,
        }
    }
}

/// How good a grasp is: its score, or its comfort where it has none.
pub(super) fn value(grasp: &Grasp) -> f32 {
    let score = grasp.score.as_ref();
    score.map_or_else(|| comfort_value(grasp.comfort), Score::total)
}
