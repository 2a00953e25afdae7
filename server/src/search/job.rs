//! One search: a checked request with everything it needs, from preparation to the response.

mod current;
mod findings;

use std::{
    ops::Deref,
    sync::{Arc, OnceLock},
    time::{Duration, Instant},
};

use grasp_assets::hands::Hand;
use grasp_proto::v1;
use grasp_synthesis::{
    base::{clock::Clock, stop::Stop},
    known::{
        entry::Entry,
        seeds::{ResizedGrips, SeedSource},
    },
    model::{grasp::Grasp, hand::HandPose, holdout::Holdout, requirements::Requirements, strategy::Choice},
    search::{
        LookUp, SearchEnd,
        current::{CurrentGraspStatus, CurrentGraspVerdict, FailedCheck, nearest_grasp},
        find_known_grasp,
        key_frames::plan_key_frames,
        scene::Task,
        settings::{Known, Query, Run, SearchSettings},
    },
};
use rayon::ThreadPool;

use super::{
    either_hand::search_either,
    holdout::holdout,
    progress::{Ended, HandPlace, Progress},
    slices::{Site, search_in_slices},
};
use crate::{
    answer::{Circumstances, ClientFrame, current_report, find_response, settle_margins},
    atlases::KnownGrips,
    error::ServiceError,
    objects::{Derived, StoredObject},
    rigs::RigHand,
    validate::{FindQuery, GiverHand},
};

/// Everything that a search needs.
#[derive(Clone, Debug)]
pub(crate) struct FindJob {
    /// The request.
    pub query: FindQuery,
    /// The object in the form that searches use. Holding this reference keeps it from being evicted.
    pub derived: Arc<Derived>,
    /// The object as stored.
    pub stored: Arc<StoredObject>,
    /// How many times as large the object is as that of `known`, if its size or mass is another one: known grips are starts
    /// then.
    pub resized: Option<f32>,
    /// The request's seed, or a drawn one.
    pub seed: u64,
    /// When the call arrived; times count from here.
    pub arrived: Instant,
    /// Effective budget.
    pub budget: Duration,
    /// How long the search continues for a first grasp if it finds none within the budget; at least the budget.
    pub patience: Duration,
    /// Whether the call has a deadline, so that its answer must not wait for a search that ends late.
    pub has_deadline: bool,
    /// Number of workers.
    pub workers: usize,
    /// How much longer the search goes on after a first valid grasp that a person would not choose.
    pub refinement: Duration,
    /// Known grips of the receiving hand, and of the alternative one.
    pub known: [KnownGrips; 2],
}

/// The result of a search.
#[derive(Debug)]
pub(crate) struct Answered {
    /// The response to the call.
    pub response: v1::FindGraspResponse,
    /// When the search ended, before the response was made.
    pub ended: Instant,
    /// The grip with its hand, if it is to be learned.
    pub new_grip: Option<(Arc<Hand>, Entry)>,
}

/// One hand's search, ready to be run.
#[derive(Debug)]
pub(super) struct HandSearch {
    pub(super) hand: RigHand,
    /// The holdout, with the arm of this hand.
    pub(super) holdout: Holdout,
    pub(super) settings: SearchSettings,
    /// Names of the preferred grips in the settings.
    preferred: Vec<String>,
}

/// A job whose holdouts and settings are ready to be searched.
#[derive(Debug)]
pub(super) struct PreparedJob {
    find: FindJob,
    /// The receiving hand's search and, if the request leaves the choice, the other hand's.
    pub(super) hands: Vec<HandSearch>,
    pub(super) start: Instant,
    /// Why the current grasp failed, once that is known.
    failed: OnceLock<FailedCheck>,
}

/// How long a look-up of known grips may take on the call's own thread, for both hands together: about as long as decoding
/// and encoding its messages. A longer look-up answers more calls without switching threads, and delays other calls.
const LOOK_UP_TIME: Duration = Duration::from_micros(200);

/// A number of tried known grips that leaves none to try.
const ALL_TRIED: usize = usize::MAX;

impl Deref for PreparedJob {
    type Target = FindJob;

    fn deref(&self) -> &FindJob {
        &self.find
    }
}

/// Time since the call's arrival.
impl Clock for FindJob {
    fn now(&self) -> Duration {
        self.arrived.elapsed()
    }
}

impl FindJob {
    /// True if preparation, look-up and response are quick enough for the call's own thread; planning key frames and meshes
    /// of hands are not. A current grasp is looked at whatever is asked of searches.
    pub(super) fn is_quick_if_known(&self) -> bool {
        let query = &self.query;
        self.known.iter().any(|known| !known.is_empty())
            && (self.looks_up() || query.current.is_some())
            && !query.plan_key_frames
            && !query.has_hand_mesh()
    }

    /// True if the first valid known grip is the answer.
    fn looks_up(&self) -> bool {
        let query = &self.query;
        self.resized.is_none()
            && !query.is_replay
            && query.choice == Choice::FirstValid
            && !query.reproducible
    }

    /// True if grips that attempts find are to be learned.
    fn learns(&self) -> bool {
        self.query.uses_atlas() && self.resized.is_none()
    }

    /// When the search has to end, with or without a grasp.
    pub(crate) fn due(&self) -> Instant {
        self.arrived + self.patience
    }

    /// Places hands and obstacles around the object and makes the settings.
    ///
    /// # Errors
    /// Those of [`holdout`].
    pub(super) fn prepare(self) -> Result<PreparedJob, ServiceError> {
        let start = Instant::now();
        let first = self.query.receiving_hand.clone();
        let stance = |hand: &RigHand| self.query.stances.of(hand.hand.rig.handedness);
        let of_first = holdout(&self.query, self.derived.object.object(), stance(&first))?;
        let object_from_client = self.query.client_from_object.inverse();
        let of_other = |hand: &RigHand| Holdout {
            stance: stance(hand).transformed(object_from_client),
            ..of_first.clone()
        };
        let alternative = self.query.alternative_hand.clone().map(|hand| {
            let holdout = of_other(&hand);
            (hand, holdout)
        });
        let hands = [(first, of_first)].into_iter().chain(alternative);
        let hands = hands.zip(&self.known).map(|((hand, holdout), known)| {
            let mut settings = self.settings(&hand.hand, known);
            let (preferred, poses): (Vec<_>, Vec<_>) = self.stored.given.preferred(&hand).into_iter().unzip();
            if !self.query.is_replay {
                settings.known.preferred = poses.into();
            }
            HandSearch {
                hand,
                holdout,
                settings,
                preferred,
            }
        });
        Ok(PreparedJob {
            hands: hands.collect(),
            failed: OnceLock::new(),
            find: self,
            start,
        })
    }

    /// The settings of one hand's search.
    fn settings(&self, hand: &Hand, known: &KnownGrips) -> SearchSettings {
        let query = &self.query;
        let object_from_client = query.client_from_object.inverse();
        // Reproducible answers need a complete atlas: a growing one would change them.
        let atlas = known.atlas.as_ref();
        let atlas = atlas.filter(|atlas| !query.reproducible || atlas.is_complete());
        let seeds = match (atlas, self.resized) {
            (Some(atlas), None) => SeedSource::Atlas(Arc::clone(atlas)),
            (Some(atlas), Some(scale)) => SeedSource::Resized(ResizedGrips {
                atlas: Arc::clone(atlas),
                scale,
            }),
            (None, _) if query.uses_seeds() => {
                let transferred = self.derived.transferred_grips(hand);
                transferred.map_or(SeedSource::Nothing, SeedSource::Transferred)
            }
            (None, _) => SeedSource::Nothing,
        };
        let requirements = Requirements {
            reach: query.stances.reach(hand.rig.handedness),
            ..query.requirements
        };
        // A replay runs one attempt and tries no known grips.
        let is_answered_by_known = !query.is_replay && self.resized.is_none();
        SearchSettings {
            query: Query {
                strategy: query.strategy,
                validity: query.validity,
                bend_ratios: query.bend_ratios,
                friction: query.friction,
                requirements: requirements.transformed(object_from_client),
                choice: query.choice,
                refinement: self.refinement,
                other_hand: query.other_hand.as_ref().map(|hand| hand.hand.rig.clone()),
                current: query
                    .current
                    .as_ref()
                    .filter(|current| current.handedness == hand.rig.handedness)
                    .map(|current| current.grasp),
                recent_hands: Arc::clone(&query.recent_hands),
            },
            known: Known {
                atlas: atlas.filter(|_| is_answered_by_known).cloned(),
                learned: is_answered_by_known.then(|| Arc::clone(&known.learned)),
                seeds,
                preferred: Arc::default(),
                tried: 0,
            },
            run: Run {
                seed: self.seed,
                reproducible: query.reproducible,
                first_attempt: query.limits.first_attempt,
                max_attempts: query.limits.max_attempts,
                deadline: Some(self.budget),
                workers: self.workers,
                record_step_times: query.record_step_times,
                observer: None,
            },
        }
    }
}

impl PreparedJob {
    /// Answers with the current grasp or the best known grip of a hand if one is found quickly; otherwise [`PreparedJob::run`]
    /// continues where this stopped.
    pub(super) fn look_up(&mut self) -> Option<Result<Answered, ServiceError>> {
        let until = self.now() + LOOK_UP_TIME;
        if let Some(place) = self.current_place() {
            if let Some(settled) = self.settle(place, Stop::when(&|| self.now() >= until)) {
                return Some(self.answer_current(place, settled));
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
                LookUp::Found(outcome) => {
                    let is_better = |best: &Ended| findings::rank(&outcome) > findings::rank(&best.outcome);
                    if best.as_ref().is_none_or(is_better) {
                        best = Some(Ended {
                            hand: place,
                            outcome: *outcome,
                        });
                    }
                }
                LookUp::NotFound { tried } => self.hands[place].settings.known.tried = tried,
            }
        }
        best.map(|best| self.answer(best))
    }

    /// Searches.
    ///
    /// # Errors
    /// The search was stopped.
    pub(super) fn run(
        &self,
        pool: &ThreadPool,
        stop: Stop<'_>,
        progress: &Progress,
    ) -> Result<Answered, ServiceError> {
        match self.current_place() {
            Some(place) if self.failed.get().is_none() => match self.settle(place, Stop::NEVER) {
                Some(settled) => self.answer_current(place, settled),
                None => self.answer(self.search(pool, stop, progress)),
            },
            _ => self.answer(self.search(pool, stop, progress)),
        }
    }

    /// Searches, without making a response.
    pub(super) fn search(&self, pool: &ThreadPool, stop: Stop<'_>, progress: &Progress) -> Ended {
        let site = Site {
            pool,
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
        if self.hands.len() > 1 {
            search_either(site, [search(0), search(1)], self.patience)
        } else {
            let (task, settings) = search(0);
            search_in_slices(site, task, settings, self.patience)
        }
    }

    /// The receiving hand or, if the request leaves the choice, both, with what each searches and by which settings.
    pub(super) fn hands(&self) -> impl Iterator<Item = (&RigHand, Task<'_>, &SearchSettings)> {
        let hands = self.hands.iter().enumerate();
        hands.map(|(place, search)| (&search.hand, self.task(place), &search.settings))
    }

    /// True once the budget is spent.
    pub(super) fn is_over(&self) -> bool {
        self.now() >= self.budget
    }

    /// The nearest known grasp to a hand, if one is valid and the budget lasts.
    pub(super) fn nearest_known(
        &self,
        task: Task<'_>,
        settings: &SearchSettings,
        from: &HandPose,
    ) -> Option<Grasp> {
        nearest_grasp(task, settings, from, Stop::when(&|| self.is_over()))
    }

    /// The frame of the response.
    pub(super) fn frame(&self) -> ClientFrame {
        ClientFrame {
            convention: self.query.convention,
            client_from_object: self.query.client_from_object,
        }
    }

    /// What was repaired in the request.
    pub(super) fn warnings(&self) -> impl Iterator<Item = &String> {
        let hands = self.query.presenting_hand.iter().chain(&self.query.other_hands);
        hands.flat_map(GiverHand::warnings)
    }

    fn task(&self, place: HandPlace) -> Task<'_> {
        let HandSearch { hand, holdout, .. } = &self.hands[place];
        Task {
            holdout,
            object: &self.derived.object,
            rig: &hand.hand.rig,
        }
    }

    /// Makes the response of an outcome.
    ///
    /// # Errors
    /// The search was stopped.
    pub(super) fn answer(&self, ended: Ended) -> Result<Answered, ServiceError> {
        self.answer_with(ended, None)
    }

    /// The same with what became of a current grasp, unless the search tells.
    fn answer_with(
        &self,
        ended: Ended,
        verdict: Option<CurrentGraspVerdict>,
    ) -> Result<Answered, ServiceError> {
        let mut ended_search = ended;
        let ended = Instant::now();
        let search_time = ended - self.start;
        if matches!(
            ended_search.outcome.end,
            SearchEnd::DeadlinePassed | SearchEnd::AttemptsExhausted
        ) {
            // A small part of what the budget leaves for the way back.
            ended_search.outcome.report.limits = self.limits();
        }
        let verdict = verdict.or_else(|| self.verdict_after(&ended_search));
        let Ended {
            hand: place,
            mut outcome,
        } = ended_search;
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
                    // Its grace alone may keep it.
                    settle_margins(grasp, report.failed_check.as_slice());
                }
            }
            response.current = Some(report);
        }
        Ok(Answered {
            response,
            ended,
            new_grip,
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
}

#[cfg(test)]
pub(super) mod tests;
