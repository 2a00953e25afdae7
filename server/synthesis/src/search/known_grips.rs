//! Known grips as candidates of a race: preferred hands, the atlas, then learned grips.
//!
//! A search for the first valid grasp tries the atlas by [`Grade`]: first the natural grips, by falling value and then by falling
//! score; the next grade only if none of them is valid.

use std::sync::{
    OnceLock,
    atomic::{AtomicUsize, Ordering},
};

use glam::Vec3;

use super::{preference::Preference, report::GraspSource, scene::Scene, settings::SearchSettings};
use crate::{
    known::{atlas::Atlas, entry::Entry, recheck::GripChecker},
    model::{
        grasp::{Contact, Grasp},
        hand::{HandPose, rig::Rig},
        regions::{Regions, suits_owner},
        score::Score,
        strategy::Choice,
    },
    physical::{
        barriers::Barriers,
        grip::Gripper,
        receiver::{Receiver, SUITABLE},
        solids::TrackedSolids,
    },
    rating::{assessment::GraspContext, scoring::comfort_value},
};

/// Grips skipped between two clock checks: one or two microseconds of work.
const GRIPS_PER_CLOCK_CHECK: usize = 64;

/// Known grips in the order in which they are tried.
#[derive(Debug)]
pub(super) struct KnownGrips<'a> {
    preferred: &'a [HandPose],
    atlas: Option<&'a Atlas>,
    /// The atlas by falling value: the order of the first pass of a search for the first valid grasp, if there are barriers or a
    /// receiver.
    by_value: Option<Vec<u16>>,
    /// The atlas by falling score, computed on first use.
    by_score: OnceLock<Vec<u16>>,
    /// The data that grades grips; `None` if grades do not matter.
    grading: Option<Grading<'a>>,
    /// Grips that earlier searches found, mostly worse than the selection in the atlas.
    learned: Option<&'a Atlas>,
    around: GraspContext<'a>,
    checker: GripChecker<'a>,
    barriers: Barriers<'a>,
    /// The next place to try, counted through `preferred`, the passes through the atlas, and `learned`.
    cursor: AtomicUsize,
}

struct Candidate<'a> {
    source: GraspSource,
    entry: &'a Entry,
    solids: Box<TrackedSolids>,
}

impl<'a> KnownGrips<'a> {
    /// The known grips that a search may use; `None` if there are none.
    pub(super) fn of(scene: &'a Scene<'a>, settings: &'a SearchSettings) -> Option<Self> {
        let around = scene.surroundings()?;
        let (object, presented) = (around.object, around.presented);
        let atlas = settings.known.atlas.as_deref();
        let preferred = &*settings.known.preferred;
        let learned = settings.learned();
        let has_any = atlas.is_some() || learned.is_some() || !preferred.is_empty();
        if !has_any || !settings.query.uses_known_grips() {
            return None;
        }
        let barriers = presented.barriers();
        let is_first_valid = settings.query.choice == Choice::FirstValid;
        let receiver = &presented.receiver;
        let by_value = is_first_valid && (!barriers.is_empty() || receiver.is_expected());
        Some(Self {
            preferred,
            atlas,
            by_value: atlas
                .filter(|_| by_value)
                .map(|atlas| atlas.by_value(presented.up, |forearm| receiver.suits_forearm(forearm))),
            by_score: OnceLock::new(),
            grading: is_first_valid.then_some(Grading {
                receiver,
                rig: around.rig,
                preference: scene.preference(),
                regions: object.object.regions(),
            }),
            learned,
            around,
            checker: GripChecker::new(around, atlas),
            barriers,
            cursor: AtomicUsize::new(settings.known.tried),
        })
    }

    /// The number of grips tried or excluded, including those that other workers are trying.
    pub(super) fn tried(&self) -> usize {
        self.cursor.load(Ordering::Relaxed)
    }

    fn passes(&self) -> usize {
        self.grading.as_ref().map_or(1, |grading| grading.grades().len())
    }

    fn wants_region(&self) -> bool {
        let grading = self.grading.as_ref();
        grading.is_some_and(|grading| grading.preference.wants_region)
    }

    fn atlas_len(&self) -> usize {
        self.atlas.map_or(0, |atlas| atlas.entries().len())
    }

    fn learned_len(&self) -> usize {
        self.learned.map_or(0, |learned| learned.entries().len())
    }

    /// The next valid grip, until `is_over`. Between two calls of it, at most [`GRIPS_PER_CLOCK_CHECK`] grips are skipped that
    /// certainly collide with a barrier.
    pub(super) fn next_valid(
        &self,
        gripper: &mut Gripper,
        is_over: impl Fn() -> bool,
    ) -> Option<(GraspSource, Box<Grasp>)> {
        let first = self.preferred.len();
        let of_atlas = self.passes() * self.atlas_len();
        let end = first + of_atlas + self.learned_len() * if self.wants_region() { 2 } else { 1 };
        let at_once = self.barriers.comparisons_per_check(GRIPS_PER_CLOCK_CHECK);
        while !is_over() {
            let from = self.cursor.load(Ordering::Relaxed);
            if from >= end {
                return None;
            }
            let preferred = self.preferred.get(from);
            let mut to = if preferred.is_some() {
                from + 1
            } else {
                end.min(from + at_once)
            };
            let mut candidate = None;
            if preferred.is_none()
                && let Some((place, found)) =
                    (from..to).find_map(|place| Some((place, self.candidate_at(place - first)?)))
            {
                to = place + 1;
                candidate = Some(found);
            }
            let taken = self
                .cursor
                .compare_exchange(from, to, Ordering::Relaxed, Ordering::Relaxed);
            if taken.is_err() {
                // Another worker took the same grips.
                continue;
            }
            let valid = if let Some(hand) = preferred {
                let grasp = self.around.hold_posed(hand, gripper).ok();
                grasp.map(|grasp| (GraspSource::Preferred(from as u16), grasp))
            } else {
                candidate.and_then(
                    |Candidate {
                         source,
                         entry,
                         solids,
                     }| { Some((source, self.checker.check(entry, &solids, gripper)?)) },
                )
            };
            if valid.is_some() {
                return valid;
            }
        }
        None
    }

    /// The grip at a place after the preferred ones, unless it certainly collides with a barrier or has the wrong grade for that
    /// place.
    fn candidate_at(&self, place: usize) -> Option<Candidate<'a>> {
        // Learned grips follow all passes or, if the owner wants a region, the passes inside it.
        let before_learned = self.atlas_len()
            * if self.wants_region() {
                CHOSEN_GRADES
            } else {
                self.passes()
            };
        let place = match place.checked_sub(before_learned) {
            None => place,
            Some(place) if place < self.learned_len() => {
                let learned = self.learned_at(place);
                let grading = self.grading.as_ref();
                return learned.filter(|learned| {
                    grading.is_none_or(|grading| !grading.is_beside_region(&learned.entry.contacts))
                });
            }
            Some(place) => before_learned + place - self.learned_len(),
        };
        if let Some(place) = place.checked_sub(self.passes() * self.atlas_len()) {
            return self.learned_at(place);
        }
        let atlas = self.atlas?;
        let (pass, rank) = (place / self.atlas_len(), place % self.atlas_len());
        let order = match &self.by_value {
            Some(order) if pass == 0 => order,
            _ => self
                .by_score
                .get_or_init(|| atlas.by_score(self.around.presented.up)),
        };
        self.screened(order[rank], pass)
    }

    /// A learned grip by its place from the newest on, unless it certainly collides with a barrier. Few look-ups get here.
    #[inline(never)]
    fn learned_at(&self, place: usize) -> Option<Candidate<'a>> {
        let learned = self.learned?;
        let index = learned.entries().len() - 1 - place;
        let solids = learned.grips().screen(index, self.around.rig, self.barriers)?;
        Some(Candidate {
            source: GraspSource::Learned(index as u16),
            entry: &learned.entries()[index],
            solids,
        })
    }

    /// A grip of the atlas, unless it certainly collides with a barrier or is not tried in this pass.
    fn screened(&self, index: u16, pass: usize) -> Option<Candidate<'a>> {
        let grips = self.atlas?.grips();
        let place = usize::from(index);
        let entry = &grips.entries()[place];
        let grading = self.grading.as_ref();
        let fit = grading.map_or(Fit::Yes, |grading| {
            grading.fit(grading.grades()[pass], grips.forearms()[place], entry)
        });
        if fit == Fit::No {
            return None;
        }
        if !self.barriers.is_empty() && !grips.may_be_clear(place, self.barriers) {
            return None;
        }
        if !grading.is_none_or(|grading| grading.has(fit, entry)) {
            return None;
        }
        let solids = if self.barriers.is_empty() {
            Box::new(entry.tracked_solids(self.around.rig))
        } else {
            grips.screen_by_second_spheres(place, self.around.rig, self.barriers)?
        };
        Some(Candidate {
            source: GraspSource::Atlas(index),
            entry,
            solids,
        })
    }
}

/// The quality of a grasp: its score, or its comfort if it has none; for two hands, their mean.
pub(super) fn grasp_value(grasp: &Grasp) -> f32 {
    let score = grasp.score.as_ref();
    let value = score.map_or_else(|| comfort_value(grasp.comfort), Score::total);
    let other = grasp.other_hand.as_deref();
    other.map_or(value, |other| 0.5 * (value + grasp_value(other)))
}

/// The number of first grades, whose grips hold the object where its owner wants hands.
pub(super) const CHOSEN_GRADES: usize = 2;

/// How well a known grip suits the receiver's position and human habits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Grade {
    /// The forearm comes from the receiver, and the grip is natural and where the owner wants it.
    Chosen,
    /// The forearm comes from the receiver, and the grip is firm and where the owner wants it.
    Firm,
    /// The forearm comes from the receiver.
    Suitable,
    /// The forearm comes roughly from the receiver.
    Possible,
    /// The grip holds.
    Valid,
}

/// The data that grades grips.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grading<'a> {
    pub(super) receiver: &'a Receiver,
    pub(super) rig: &'a Rig,
    pub(super) preference: Preference,
    pub(super) regions: &'a Regions,
}

/// Whether a grip has a grade, by the cheap tests alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fit {
    No,
    Yes,
    /// If the receiver's arm reaches the wrist.
    IfReached,
    /// If the receiver's arm does not reach the wrist.
    UnlessReached,
}

impl Grading<'_> {
    /// True if the contacts are outside a free region that the object's owner prefers.
    pub(super) fn is_beside_region(&self, contacts: &[Contact]) -> bool {
        self.preference.wants_region && !suits_owner(&self.regions.values(contacts))
    }

    pub(super) fn fit(&self, grade: Grade, forearm: Vec3, entry: &Entry) -> Fit {
        let suits = self.receiver.suits_forearm(forearm);
        if suits < SUITABLE {
            let only = if suits <= 0.0 {
                Grade::Valid
            } else {
                Grade::Possible
            };
            return if grade == only { Fit::Yes } else { Fit::No };
        }
        let preference = self.preference;
        let values = &entry.grip_values;
        let suits_owner = || self.regions.is_empty() || suits_owner(&self.regions.values(&entry.contacts));
        let is_chosen = || preference.is_met_by_grip(values, entry.classification, false) && suits_owner();
        let is_firm = || preference.is_firm(values, false) && suits_owner();
        let fits = match grade {
            Grade::Chosen => is_chosen(),
            Grade::Firm => is_firm() && !is_chosen(),
            Grade::Suitable => !is_firm(),
            Grade::Possible => return Fit::UnlessReached,
            Grade::Valid => false,
        };
        if fits { Fit::IfReached } else { Fit::No }
    }

    /// Completes [`Self::fit`] by the test of the arm, which takes about a microsecond.
    pub(super) fn has(&self, fit: Fit, entry: &Entry) -> bool {
        let is_reached = || self.receiver.suits(self.rig, entry.grip.pose.frame_from_wrist) >= SUITABLE;
        match fit {
            Fit::No => false,
            Fit::Yes => true,
            Fit::IfReached => is_reached(),
            Fit::UnlessReached => !is_reached(),
        }
    }

    /// The applicable grades, best first; each is a pass through the atlas.
    pub(super) fn grades(&self) -> &'static [Grade] {
        let all = &[
            Grade::Chosen,
            Grade::Firm,
            Grade::Suitable,
            Grade::Possible,
            Grade::Valid,
        ];
        if self.receiver.is_expected() {
            all
        } else {
            &all[..3]
        }
    }
}
