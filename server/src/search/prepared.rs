//! A search that is ready to run, from the look-up of known grips to the response: the grasp and its source, grips passed over, the
//! grip to learn, the fate of a current grasp, and limits that keep a search from finding one.

use std::{
    ops::Deref,
    sync::{Arc, OnceLock},
    time::{Duration, Instant},
};

use grasp_assets::hands::Hand;
use grasp_proto::v1;
use grasp_synthesis::{
    base::{clock::Clock, stop::Stop},
    known::entry::Entry,
    model::{grasp::Grasp, holdout::Holdout, strategy::Validity},
    search::{
        GraspSource, SearchEnd, SearchOutcome,
        current::{
            CurrentGraspStatus, CurrentGraspVerdict, FailedCheck, Settlement, no_grasp_reason, passed_over,
            settle,
        },
        find_known_grasp,
        key_frames::plan_key_frames,
        limits::{Limit, known_limit, limits},
        scene::{Scene, Task},
        settings::SearchSettings,
    },
};

use super::{
    either_hand::search_either,
    job::FindJob,
    slices::{Ended, HandPlace, Progress, Site, search_in_slices},
};
use crate::{
    answer::{
        Circumstances, ClientFrame, atlas_used, current_report, find_response, settle_margins, wire_origin,
    },
    call::SearchSummary,
    error::ServiceError,
    executor::Workers,
    rigs::RigHand,
    validate::GiverHand,
};

/// How long a look-up of known grips may take on the call's own thread, for both hands together. A longer one delays other calls.
const LOOK_UP_TIME: Duration = Duration::from_micros(200);

/// Marks all known grips as tried.
const ALL_TRIED: usize = usize::MAX;

/// The result of a search, or of other work on a holdout.
#[derive(Debug)]
pub(crate) struct Answered<T = v1::FindGraspResponse> {
    pub response: T,
    /// When the work ended, before the response was made.
    pub ended: Instant,
    pub summary: SearchSummary,
    /// The grip with its hand, if it is to be learned.
    pub new_grip: Option<(Arc<Hand>, Entry)>,
}

#[derive(Debug)]
pub(super) struct HandSearch {
    pub(super) hand: RigHand,
    /// The holdout, with the arm of this hand.
    pub(super) holdout: Holdout,
    pub(super) settings: SearchSettings,
    /// Names of the preferred grips in the settings.
    pub(super) preferred: Vec<String>,
}

/// A job whose holdouts and settings are ready to be searched.
#[derive(Debug)]
pub(super) struct PreparedJob {
    pub(super) find: FindJob,
    /// The receiving hand's search and, if the request leaves the choice, the other hand's.
    pub(super) hands: Vec<HandSearch>,
    pub(super) start: Instant,
    /// Why the current grasp failed, once that is known.
    pub(super) failed: OnceLock<FailedCheck>,
}

impl Deref for PreparedJob {
    type Target = FindJob;

    fn deref(&self) -> &FindJob {
        &self.find
    }
}

impl PreparedJob {
    /// Answers with the current grasp or the best known grip of a hand if one is found quickly; otherwise [`PreparedJob::run`]
    /// continues where this stopped.
    pub(super) fn look_up(&mut self) -> Option<Result<Answered, ServiceError>> {
        let until = self.now() + LOOK_UP_TIME;
        if let Some(place) = self.current_place() {
            if let Some((ended, verdict)) = self.settle(place, Stop::when(&|| self.now() >= until)) {
                return Some(self.answer(ended, Some(verdict)));
            }
            // Out of time, unless it failed.
            self.failed.get()?;
            self.hands[place].settings.known.tried = ALL_TRIED;
        }
        if !self.looks_up() {
            return None;
        }
        let mut best: Option<Ended> = None;
        for place in 0..self.hands.len() {
            if self.hands[place].settings.known.tried == ALL_TRIED {
                continue;
            }
            let hands_left = (self.hands.len() - place) as u32;
            let within = until.saturating_sub(self.now()) / hands_left;
            let HandSearch { settings, .. } = &self.hands[place];
            match find_known_grasp(self.task(place), settings, &self.find, within) {
                Ok(outcome) => {
                    let is_better = |best: &Ended| rank(&outcome) > rank(&best.outcome);
                    if best.as_ref().is_none_or(is_better) {
                        best = Some(Ended { hand: place, outcome });
                    }
                }
                Err(tried) => self.hands[place].settings.known.tried = tried,
            }
        }
        best.map(|best| self.answer(best, None))
    }

    pub(super) fn run(
        &self,
        workers: Workers<'_>,
        stop: Stop<'_>,
        progress: &Progress,
    ) -> Result<Answered, ServiceError> {
        if self.failed.get().is_none()
            && let Some(place) = self.current_place()
            && let Some((ended, verdict)) = self.settle(place, Stop::NEVER)
        {
            return self.answer(ended, Some(verdict));
        }
        self.answer(self.search(workers, stop, progress), None)
    }

    /// Searches, without making a response.
    pub(super) fn search(&self, workers: Workers<'_>, stop: Stop<'_>, progress: &Progress) -> Ended {
        let site = Site {
            workers,
            clock: &self.find,
            stop,
            progress,
        };
        let mut settings: Vec<SearchSettings> = self.hands.iter().map(|hand| hand.settings.clone()).collect();
        if let (Some(place), Some(_)) = (self.current_place(), self.failed.get()) {
            // All known grips were tried when it failed.
            settings[place].known.tried = ALL_TRIED;
        }
        let search = |place: HandPlace| (self.task(place), &settings[place]);
        let ended = if self.hands.len() > 1 {
            search_either(site, [search(0), search(1)], self.patience)
        } else {
            search_in_slices(site, search(0), self.patience)
        };
        workers.end_turn();
        ended
    }

    pub(super) fn frame(&self) -> ClientFrame {
        ClientFrame {
            convention: self.query.convention,
            client_from_object: self.query.client_from_object,
            packs: self.query.packs,
        }
    }

    /// Repairs made to the request.
    pub(super) fn warnings(&self) -> impl Iterator<Item = &String> {
        let hands = self.query.presenting_hand.iter().chain(&self.query.other_hands);
        hands.flat_map(GiverHand::warnings)
    }

    pub(super) fn task(&self, place: HandPlace) -> Task<'_> {
        let HandSearch { hand, holdout, .. } = &self.hands[place];
        Task {
            holdout,
            object: &self.derived.object,
            rig: &hand.hand.rig,
        }
    }

    /// Makes the response of an outcome, with the verdict on a current grasp unless the search has one.
    pub(super) fn answer(
        &self,
        ended: Ended,
        verdict: Option<CurrentGraspVerdict>,
    ) -> Result<Answered, ServiceError> {
        let Ended {
            hand: place,
            mut outcome,
        } = ended;
        let ended = Instant::now();
        let search_time = ended - self.start;
        if matches!(
            outcome.end,
            SearchEnd::DeadlinePassed | SearchEnd::AttemptsExhausted
        ) {
            // Takes a small part of the time reserved for the response.
            outcome.report.limits = self.limits();
        }
        let verdict = verdict.or_else(|| self.verdict_after(place, &outcome));
        let hand = &self.hands[place].hand;
        let is_kept = verdict.is_some_and(|verdict| verdict.status == CurrentGraspStatus::Kept);
        let is_known = is_kept && self.query.changes_only;
        if let Some(grasp) = &mut outcome.grasp
            && !is_known
        {
            self.plan_key_frames(place, grasp);
        }
        let frame = self.frame();
        let source = outcome.report.source;
        let circumstances = Circumstances {
            search_time,
            budget: self.budget,
            origin: self.origin(place, source),
            passed_over: &self.passed_over(place, source),
            warnings: self.warnings().cloned().collect(),
            is_known,
        };
        let new_grip = self.new_grip(&outcome, place);
        let hands = (hand, self.query.other_hand.as_ref());
        let mut response = find_response(&outcome, hands, frame, circumstances)?;
        if let (Some(given), Some(verdict)) = (&self.query.current, verdict) {
            let report = current_report(&verdict, hand, frame);
            if let (CurrentGraspStatus::Kept | CurrentGraspStatus::Adjusted, Some(grasp)) =
                (verdict.status, response.grasps.first_mut())
            {
                // Rounding to and from the client's convention would move the hand a little with every request.
                grasp.hand.get_or_insert_default().object_from_wrist = Some(given.object_from_wrist);
                if is_kept {
                    // It may be valid only by its grace.
                    settle_margins(grasp, report.failed_check.as_slice());
                }
            }
            response.current = Some(report);
        }
        Ok(Answered {
            ended,
            summary: SearchSummary {
                outcome: response.outcome().as_str_name(),
                attempts: response.attempts(),
                time: response.search_time(),
                failed_check: failed_check(&response),
            },
            new_grip,
            response,
        })
    }

    /// Plans a grasp's key frames, if the request asks for them.
    pub(super) fn plan_key_frames(&self, place: HandPlace, grasp: &mut Grasp) {
        if !self.query.plan_key_frames {
            return;
        }
        let HandSearch {
            hand,
            holdout,
            settings,
            ..
        } = &self.hands[place];
        let approach = settings.query.requirements.approach;
        let friction = settings.query.friction_on(&holdout.object);
        plan_key_frames(holdout, &hand.hand.rig, friction, approach, grasp);
    }

    /// The verdict on the current grasp without a search; `None` if it failed a check and no known grip replaces it, or if `stop`
    /// says so first.
    fn settle(&self, place: HandPlace, stop: Stop<'_>) -> Option<(Ended, CurrentGraspVerdict)> {
        let settings = &self.hands[place].settings;
        match settle(&Scene::new(self.task(place), settings), settings, stop)? {
            Settlement::Settled(settled) => {
                let (outcome, verdict) = *settled;
                Some((Ended { hand: place, outcome }, verdict))
            }
            Settlement::Failed(failed) => {
                self.failed.get_or_init(|| failed);
                None
            }
            Settlement::Stopped => None,
        }
    }

    fn current_place(&self) -> Option<HandPlace> {
        let has_it = |hand: &HandSearch| hand.settings.query.current.is_some();
        self.hands.iter().position(has_it)
    }

    /// The verdict on a current grasp that failed a check, after a search with one hand.
    fn verdict_after(&self, hand: HandPlace, outcome: &SearchOutcome) -> Option<CurrentGraspVerdict> {
        let place = self.current_place()?;
        let settings = &self.hands[place].settings;
        let scene = Scene::new(self.task(place), settings);
        let failed = self.failed.get().copied();
        let mut verdict = CurrentGraspVerdict::after_search(&scene, failed, outcome, hand == place);
        if verdict.status == CurrentGraspStatus::None {
            verdict.no_grasp = Some(no_grasp_reason(&scene, settings, &outcome.report.limits));
        }
        Some(verdict)
    }

    /// The source of an answer with one hand, and the atlases used for each hand, that one's first.
    pub(super) fn origin(&self, answered: HandPlace, source: Option<GraspSource>) -> v1::GraspOrigin {
        let HandSearch {
            settings, preferred, ..
        } = &self.hands[answered];
        let others = (0..self.hands.len()).filter(|&place| place != answered);
        let hands = std::iter::once(answered).chain(others);
        v1::GraspOrigin {
            known_grip: match source {
                Some(GraspSource::Preferred(index)) => preferred[usize::from(index)].clone(),
                _ => String::new(),
            },
            atlases: hands.filter_map(|place| self.atlas_used(place)).collect(),
            ..wire_origin(source, settings.run.seed)
        }
    }

    /// The atlas that the search with a hand uses; `None` if nothing is known.
    pub(super) fn atlas_used(&self, place: HandPlace) -> Option<v1::Atlas> {
        let HandSearch { hand, settings, .. } = &self.hands[place];
        atlas_used(&self.query.object_id, hand.hand.rig.handedness, settings)
    }

    /// Names of the preferred grips that were tried before an answer with one hand, and the checks that they failed.
    fn passed_over(&self, answered: HandPlace, source: Option<GraspSource>) -> Vec<(&str, FailedCheck)> {
        if source == Some(GraspSource::Current) {
            return Vec::new();
        }
        let mut all = Vec::new();
        for (place, search) in self.hands.iter().enumerate() {
            let count = match source {
                Some(GraspSource::Preferred(index)) if place == answered => usize::from(index),
                _ => usize::MAX,
            };
            let failures = passed_over(self.task(place), &search.settings, count).into_iter();
            all.extend(failures.map(|(index, failed)| (search.preferred[index].as_str(), failed)));
        }
        all
    }

    /// The grip to learn: found by an attempt under the object's own friction and size.
    fn new_grip(&self, outcome: &SearchOutcome, place: HandPlace) -> Option<(Arc<Hand>, Entry)> {
        let HandSearch {
            hand,
            holdout,
            settings,
            ..
        } = &self.hands[place];
        let own_friction = holdout.object.friction_under(Validity::Physical);
        let is_new = matches!(outcome.report.source, Some(GraspSource::Attempt(_)));
        if !self.learns() || !is_new || settings.query.friction_on(&holdout.object) != own_friction {
            return None;
        }
        let entry = Entry::of_grasp(outcome.grasp.as_ref()?)?;
        Some((Arc::clone(&hand.hand), entry))
    }

    /// Limits that keep each hand from holding the object. If none are proven, known grips show the obstacles; a hand without known
    /// grips counts like the other.
    pub(super) fn limits(&self) -> Vec<Limit> {
        let hands = || self.hands.iter().enumerate();
        let proven = of_each(hands().map(|(place, search)| limits(self.task(place), &search.settings.query)));
        if !proven.is_empty() {
            return proven;
        }
        let knows = |search: &HandSearch| {
            let atlas = search.settings.known.atlas.as_ref();
            atlas.is_some_and(|atlas| !atlas.entries().is_empty())
        };
        let none_knows = !self.hands.iter().any(knows);
        let judged = hands().filter(|(_, search)| none_knows || knows(search));
        of_each(judged.map(|(place, search)| {
            let limit = known_limit(self.task(place), &search.settings);
            limit.into_iter().collect()
        }))
    }
}

/// The check that the current grasp fails or, without a grasp, that the holdout or the nearest miss fails.
fn failed_check(response: &v1::FindGraspResponse) -> Option<v1::Check> {
    let of_current = response
        .current
        .iter()
        .filter_map(|current| current.failed_check.as_ref());
    let report = response.report.as_ref().filter(|_| response.grasps.is_empty());
    let of_limits = report.into_iter().flat_map(|report| &report.limits);
    let of_miss = report.and_then(|report| report.nearest_miss.as_ref()?.verdict.as_ref());
    let first = of_current.chain(of_limits).chain(of_miss).next();
    first.map(v1::Verdict::check)
}

/// How a known grip of one hand ranks against one of the other: preferred ones first, those of atlases before learned ones.
fn rank(outcome: &SearchOutcome) -> (bool, bool, bool, f32) {
    let source = outcome.report.source;
    let is_preferred = source.is_some_and(GraspSource::is_preferred);
    let is_learned = source.is_some_and(GraspSource::is_learned);
    (
        is_preferred,
        outcome.replaceable_until.is_none(),
        !is_learned,
        outcome.value,
    )
}

/// The limits of all hands, one of each kind; `None` if a hand has none.
fn of_each(hands: impl Iterator<Item = Vec<Limit>>) -> Vec<Limit> {
    let mut all: Vec<Limit> = Vec::new();
    for of_hand in hands {
        if of_hand.is_empty() {
            return of_hand;
        }
        let new = |limit: &Limit| all.iter().all(|known| known.check != limit.check);
        let new: Vec<Limit> = of_hand.into_iter().filter(new).collect();
        all.extend(new);
    }
    all
}
