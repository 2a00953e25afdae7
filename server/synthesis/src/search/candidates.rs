//! The grips of an atlas as candidates of a race.

use std::sync::{
    OnceLock,
    atomic::{AtomicUsize, Ordering},
};

use super::SearchSettings;
use crate::{
    atlas::{Atlas, Excluded, asked::Asked},
    grasp::Grasp,
    hand::rig::Rig,
    physical::{grip::Gripper, scene::Presented, solids::HandSolids},
    score::{Score, comfort_value},
    synthesis::scene::Scene,
};

/// Grips that are tried before it is asked which are out of the question: asking takes as long as looking at some fifty one
/// by one, and one of the first is often the answer.
const TRIED_ONE_BY_ONE: usize = 48;

/// Grips that are passed over at most before somebody looks at the clock: one or two microseconds' worth.
const PASSED_AT_ONCE: usize = 64;

/// The grips of an atlas in the order in which they are tried.
#[derive(Debug)]
pub(super) struct KnownGrips<'a> {
    atlas: &'a Atlas,
    order: &'a [u16],
    scene: &'a Scene<'a>,
    asked: Asked<'a>,
    presented: &'a Presented,
    rig: &'a Rig,
    /// Those that certainly meet the giver, once somebody asks.
    excluded: OnceLock<Option<Excluded<'a>>>,
    /// The next place in the order that nobody has taken.
    next: AtomicUsize,
}

/// What was taken of the known grips.
enum Taken {
    /// There are no more.
    NoneLeft,
    /// Some that certainly meet the giver.
    NoneOpen,
    /// One that may not, an index of the atlas with its solids, and those before it.
    Open(u16, Box<HandSolids>),
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
        Some(Self {
            atlas,
            order: atlas.by_score(presented.up),
            scene,
            asked: Asked::new(object, scene.rig(), presented),
            presented,
            rig: scene.rig(),
            excluded: OnceLock::new(),
            next: AtomicUsize::new(0),
        })
    }

    /// Those that certainly meet the giver, if there is one.
    fn excluded(&self) -> Option<&Excluded<'a>> {
        let excluded = self.excluded.get_or_init(|| {
            let giver = self.presented.giver.as_ref();
            giver.map(|giver| self.atlas.excluded_by(giver))
        });
        excluded.as_ref()
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.order.len()
    }

    /// Takes the next one that does not certainly meet the giver, if one of the next [`PASSED_AT_ONCE`] is such.
    fn take(&self) -> Taken {
        loop {
            let from = self.next.load(Ordering::Relaxed);
            let Some(left) = self.order.get(from..).filter(|left| !left.is_empty()) else {
                return Taken::NoneLeft;
            };
            let excluded = if from < TRIED_ONE_BY_ONE {
                None
            } else {
                self.excluded()
            };
            let next = &left[..left.len().min(PASSED_AT_ONCE)];
            let open = next.iter().enumerate().find_map(|(place, &entry)| {
                let is_excluded = excluded.is_some_and(|excluded| excluded.contains(entry));
                let solids = if is_excluded { None } else { self.unless_met(entry) };
                Some((place, solids?))
            });
            let to = from + open.as_ref().map_or(next.len(), |(place, _)| place + 1);
            // Another worker may have taken the same meanwhile; then they are looked at in vain.
            let taken = self
                .next
                .compare_exchange(from, to, Ordering::Relaxed, Ordering::Relaxed);
            if taken.is_ok() {
                return open.map_or(Taken::NoneOpen, |(place, solids)| {
                    Taken::Open(next[place], solids)
                });
            }
        }
    }

    /// The solids of a grip that does not certainly meet the giver.
    fn unless_met(&self, entry: u16) -> Option<Box<HandSolids>> {
        let entry = usize::from(entry);
        match &self.presented.giver {
            None => Some(Box::new(self.atlas.entries()[entry].solids(self.rig))),
            Some(giver) => self.atlas.grips().unless_met(entry, self.rig, giver),
        }
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
