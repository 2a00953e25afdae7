//! One search: a checked request with everything it needs, from preparation to the response.

use std::{
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use grasp_proto::v1;
use grasp_synthesis::{
    base::{clock::Clock, mechanisms::Mechanisms},
    known::{entry::Entry, recent_grips::RecentGrips, seed_source::SeedSource},
    model::{
        holdout::Holdout,
        strategy::{Choice, Validity},
    },
    propose::prepared::PreparedObject,
    search::{
        GraspSource, LookUp, SearchOutcome, find_known_grasp,
        key_frames::plan_key_frames,
        scene::Task,
        settings::{Known, Query, Run, SearchSettings},
    },
};
use rayon::ThreadPool;

use super::{holdout::holdout, slices::search_in_slices};
use crate::{
    answer::{Circumstances, ClientFrame, find_response},
    atlases::KnownGrips,
    error::ServiceError,
    executor::{Admission, SearchExecutor},
    objects::StoredObject,
    validate::FindQuery,
};

/// Everything that a search needs.
#[derive(Debug)]
pub(crate) struct FindJob {
    /// The request.
    pub query: FindQuery,
    /// The object. Holding this reference keeps it from being evicted.
    pub object: Arc<PreparedObject>,
    /// The same object as stored, for its transferred grips.
    pub stored: Arc<StoredObject>,
    /// The request's seed, or a drawn one.
    pub seed: u64,
    /// When the call arrived; times count from here.
    pub arrived: Instant,
    /// Effective budget.
    pub budget: Duration,
    /// How long the search continues for a first grasp if it finds none within the budget; at least the budget.
    pub patience: Duration,
    /// Number of workers.
    pub workers: usize,
    /// Known grips of the object and the hand.
    pub known: KnownGrips,
    /// Mechanisms of the search that are on.
    pub mechanisms: Mechanisms,
}

/// The result of a search.
#[derive(Debug)]
pub(crate) struct Answered {
    /// The response to the call.
    pub response: v1::FindGraspResponse,
    /// The grip if it was not known before, to be remembered.
    pub new_grip: Option<Entry>,
}

/// A job whose holdout and settings are ready to be searched.
#[derive(Debug)]
struct PreparedJob {
    query: FindQuery,
    object: Arc<PreparedObject>,
    holdout: Holdout,
    settings: SearchSettings,
    clock: SinceArrival,
    start: Instant,
    budget: Duration,
    patience: Duration,
}

/// How long a look-up of known grips may take on the call's own thread: about as long as decoding and encoding its
/// messages. A longer look-up answers more calls without switching threads, and delays other calls.
const LOOK_UP_TIME: Duration = Duration::from_micros(200);

/// Time since a call's arrival.
#[derive(Debug)]
struct SinceArrival(Instant);

impl Clock for SinceArrival {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

/// Runs a job: looks known grips up on this thread if that is quick, else searches on the executor.
///
/// # Errors
/// The giver's joints fold its skin, or the search was stopped or panicked.
pub(crate) async fn find(
    job: FindJob,
    executor: &SearchExecutor,
    admission: Admission,
) -> Result<Answered, ServiceError> {
    if !job.is_quick_if_known() {
        let run = executor.run(admission, move |pool, stop| job.prepare()?.run(pool, stop));
        return run.await?;
    }
    let mut job = job.prepare()?;
    if let Some(answered) = job.look_up() {
        return answered;
    }
    executor
        .run(admission, move |pool, stop| job.run(pool, stop))
        .await?
}

impl FindJob {
    /// True if preparation, look-up and response are quick enough for the call's own thread; planning key frames is
    /// not.
    fn is_quick_if_known(&self) -> bool {
        (self.known.atlas.is_some() || !self.known.recent.is_empty())
            && !self.query.is_replay
            && self.query.choice == Choice::FirstValid
            && !self.query.reproducible
            && !self.query.plan_key_frames
    }

    /// Places hands and obstacles around the object and makes the settings.
    ///
    /// # Errors
    /// The giver's joints fold its skin.
    fn prepare(self) -> Result<PreparedJob, ServiceError> {
        let start = Instant::now();
        let query = self.query;
        let object_from_client = query.client_from_object.inverse();
        let holdout = holdout(&query, self.object.object())?;
        // Reproducible answers need a complete atlas: a growing one would change them.
        let atlas = self
            .known
            .atlas
            .filter(|atlas| !query.reproducible || atlas.is_complete());
        let seeds = match &atlas {
            Some(atlas) => SeedSource::Atlas(Arc::clone(atlas)),
            None if query.strategy.uses_known_grips(query.validity) => {
                let transferred = self.stored.transferred_grips(query.receiving_hand);
                transferred.map_or(SeedSource::Nothing, SeedSource::Transferred)
            }
            None => SeedSource::Nothing,
        };
        let settings = SearchSettings {
            query: Query {
                strategy: query.strategy,
                validity: query.validity,
                bend_ratios: query.bend_ratios,
                friction: query.friction,
                constraints: query.constraints.transformed(object_from_client),
                choice: query.choice,
            },
            known: Known {
                // A replay runs one attempt and tries no known grips.
                atlas: atlas.filter(|_| !query.is_replay),
                seeds,
                recent: if query.is_replay {
                    RecentGrips::default()
                } else {
                    self.known.recent
                },
                tried: 0,
            },
            run: Run {
                seed: self.seed,
                reproducible: query.reproducible,
                first_attempt: query.first_attempt,
                max_attempts: query.max_attempts,
                deadline: Some(self.budget),
                workers: self.workers,
                record_step_times: query.record_step_times,
                mechanisms: self.mechanisms,
            },
        };
        Ok(PreparedJob {
            query,
            object: self.object,
            holdout,
            settings,
            clock: SinceArrival(self.arrived),
            start,
            budget: self.budget,
            patience: self.patience,
        })
    }
}

impl PreparedJob {
    /// Answers with a known grip if one is found quickly; otherwise [`PreparedJob::run`] continues where this stopped.
    fn look_up(&mut self) -> Option<Result<Answered, ServiceError>> {
        match find_known_grasp(self.task(), &self.settings, &self.clock, LOOK_UP_TIME) {
            LookUp::Found(outcome) => Some(self.answer(*outcome)),
            LookUp::NotFound { tried } => {
                self.settings.known.tried = tried;
                None
            }
        }
    }

    /// Searches.
    ///
    /// # Errors
    /// The search was stopped.
    fn run(&self, pool: &ThreadPool, stop: &AtomicBool) -> Result<Answered, ServiceError> {
        let outcome = search_in_slices(
            pool,
            self.task(),
            &self.settings,
            self.patience,
            &self.clock,
            stop,
        );
        self.answer(outcome)
    }

    fn task(&self) -> Task<'_> {
        Task {
            holdout: &self.holdout,
            object: &self.object,
            rig: &self.query.receiving_hand.rig,
        }
    }

    fn answer(&self, mut outcome: SearchOutcome) -> Result<Answered, ServiceError> {
        let rig = &self.query.receiving_hand.rig;
        let search_time = self.start.elapsed();
        if let (true, Some(grasp)) = (self.query.plan_key_frames, &mut outcome.grasp) {
            let approach = self.settings.query.constraints.approach;
            let friction = self.settings.query.friction_on(&self.holdout.object);
            plan_key_frames(&self.holdout, rig, friction, approach, grasp);
        }
        let frame = ClientFrame {
            convention: self.query.convention,
            client_from_object: self.query.client_from_object,
        };
        let circumstances = Circumstances {
            search_time,
            budget: self.budget,
        };
        Ok(Answered {
            response: find_response(&outcome, rig, frame, &self.settings, circumstances)?,
            new_grip: self.new_grip(&outcome),
        })
    }

    /// The grip to remember: one that was found by an attempt under the object's own friction, which the grips of an
    /// atlas are made for.
    fn new_grip(&self, outcome: &SearchOutcome) -> Option<Entry> {
        let own_friction = self.holdout.object.friction_under(Validity::Physical);
        let is_new = matches!(outcome.report.source, Some(GraspSource::Attempt(_)));
        let grasp = outcome.grasp.as_ref()?;
        (is_new && self.settings.query.friction_on(&self.holdout.object) == own_friction)
            .then(|| Entry::of_grasp(grasp))
            .flatten()
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use grasp_assets::hands::{self, RIG_NAMES};
    use grasp_synthesis::model::hand::{Handedness, rig::AngleRange};
    use proptest::{
        prelude::*,
        test_runner::{Config, RngSeed, TestRunner},
    };

    use super::*;
    use crate::{
        budget::effective_budget,
        config,
        objects::{StoredObject, tests::tetrahedron},
        validate::{any_obstacles, find_query},
    };

    /// Any number that a client may send, most of them ordinary.
    fn number(ordinary: std::ops::Range<f32>) -> impl Strategy<Value = f32> {
        prop_oneof![1000 => ordinary, 1 => any::<f32>(), 1 => Just(0.0)]
    }

    fn vector(ordinary: f32) -> impl Strategy<Value = v1::Vector3> {
        [
            number(-ordinary..ordinary),
            number(-ordinary..ordinary),
            number(-ordinary..ordinary),
        ]
        .prop_map(|[x, y, z]| v1::Vector3 { x, y, z })
    }

    /// Mostly unit quaternions.
    fn quaternion() -> impl Strategy<Value = v1::Quaternion> {
        let turned =
            (-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0, -4.0_f32..4.0).prop_map(|(x, y, z, angle)| {
                let axis = glam::Vec3::new(x, y, z).normalize_or(glam::Vec3::X);
                let [x, y, z, w] = glam::Quat::from_axis_angle(axis, angle).to_array();
                v1::Quaternion { x, y, z, w }
            });
        let any = any::<[f32; 4]>().prop_map(|[x, y, z, w]| v1::Quaternion { x, y, z, w });
        prop_oneof![500 => turned, 1 => any]
    }

    fn pose(ordinary: f32) -> impl Strategy<Value = Option<v1::Pose>> {
        let pose = (
            proptest::option::of(vector(ordinary)),
            proptest::option::of(quaternion()),
        );
        proptest::option::weighted(
            0.998,
            pose.prop_map(|(position, orientation)| v1::Pose {
                position,
                orientation,
            }),
        )
    }

    fn tracked_hand() -> impl Strategy<Value = v1::presenting_hand::Form> {
        let joint = (pose(0.12), number(0.001..0.05)).prop_map(|(client_from_joint, radius)| v1::JointPose {
            client_from_joint,
            radius,
        });
        (proptest::collection::vec(joint, 26), 1..=2_i32, any::<bool>()).prop_map(
            |(mut joints, handedness, webxr)| {
                let joint_set = if webxr {
                    joints.pop();
                    v1::JointSet::Webxr25
                } else {
                    v1::JointSet::Openxr26
                };
                v1::presenting_hand::Form::Joints(v1::HandJoints {
                    handedness,
                    joint_set: joint_set.into(),
                    joints,
                })
            },
        )
    }

    /// Angles given as shares of their ranges.
    fn angled_hand() -> impl Strategy<Value = v1::presenting_hand::Form> {
        let shares = proptest::collection::vec([number(0.0..1.0), number(0.0..1.0), number(0.0..1.0)], 5);
        (shares, pose(0.2), 1..=2_i32, 0..RIG_NAMES.len()).prop_map(
            |(shares, client_from_wrist, handedness, rig)| {
                let rig = RIG_NAMES[rig];
                let hand = hands::hand(rig, Handedness::Right).expect("the rig is built in");
                let within = |range: AngleRange, share: f32| range.min + share * (range.max - range.min);
                let digits = hand.rig.digits.iter().zip(shares);
                v1::presenting_hand::Form::Angles(v1::HandAngles {
                    rig: rig.to_owned(),
                    handedness,
                    client_from_wrist,
                    digits: digits
                        .map(|(digit, share)| v1::DigitAngles {
                            base_yaw: within(digit.limits.base_yaw, share[0]),
                            base_pitch: within(digit.limits.base_pitch, share[1]),
                            second_pitch: within(digit.limits.second_pitch, share[2]),
                            third_pitch: None,
                        })
                        .collect(),
                })
            },
        )
    }

    fn request() -> impl Strategy<Value = v1::FindGraspRequest> {
        let hand = || {
            prop_oneof![tracked_hand(), angled_hand()]
                .prop_map(|form| v1::PresentingHand { form: Some(form) })
        };
        let others = (proptest::option::weighted(0.2, hand()), any_obstacles());
        (
            (proptest::option::of(hand()), others),
            pose(2.0),
            proptest::option::of(vector(1.0)),
            (0..8_i32, 0..8_i32, 0..6_i32),
            any::<(Option<u64>, Option<u64>, bool)>(),
            proptest::option::of(number(0.05..2.0)),
        )
            .prop_map(
                |(
                    (presenting_hand, (other_hand, obstacles)),
                    client_from_object,
                    up,
                    enums,
                    (seed, only_attempt, reproducible),
                    friction,
                )| {
                    v1::FindGraspRequest {
                        object: "objects/any".to_owned(),
                        client_from_object,
                        presenting_hand,
                        up,
                        max_attempts: Some(2),
                        strategy: enums.0,
                        bend_ratios: enums.1,
                        convention: enums.2,
                        seed,
                        only_attempt,
                        reproducible,
                        friction,
                        plan_key_frames: true,
                        other_hands: other_hand.into_iter().collect(),
                        obstacles,
                        ..Default::default()
                    }
                },
            )
    }

    /// Objects from a speck to a beam.
    fn objects() -> impl Strategy<Value = StoredObject> {
        prop_oneof![Just(0.002_f32), Just(0.05), Just(9.0)].prop_map(|edge| tetrahedron("any", edge, &[1]))
    }

    fn runs() -> Config {
        Config {
            cases: 1000,
            rng_seed: RngSeed::Fixed(2),
            failure_persistence: None,
            ..Config::default()
        }
    }

    #[test]
    fn answers_every_request_that_passes_validation() {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .expect("a thread");
        let searched = Cell::new([0; 3]);
        let outcome = TestRunner::new(runs()).run(&(request(), objects()), |(request, object)| {
            let arrived = Instant::now();
            let Ok(query) = find_query(request, "thesis", |_| true) else {
                return Ok(());
            };
            let kind = match &query.presenting_hand {
                None => 0,
                Some(giver) if giver.field.ends_with("angles") => 1,
                Some(_) => 2,
            };
            let mut counts = searched.get();
            counts[kind] += 1;
            searched.set(counts);
            let budgets = config::Config::default().budgets;
            let job = FindJob {
                budget: effective_budget(query.budget, budgets, arrived, None),
                patience: Duration::ZERO,
                query,
                object: Arc::clone(&object.object),
                stored: Arc::new(object),
                seed: 3,
                arrived,
                workers: 1,
                known: KnownGrips::default(),
                mechanisms: Mechanisms::ALL,
            };
            match job
                .prepare()
                .and_then(|job| job.run(&pool, &AtomicBool::new(false)))
            {
                Ok(Answered { response: answer, .. }) => {
                    let report = answer.report.expect("every answer has a report");
                    prop_assert!(report.attempts <= 2);
                    prop_assert_eq!(
                        answer.grasp.is_some(),
                        answer.outcome == i32::from(v1::Outcome::Found)
                    );
                    for joint in answer.grasp.iter().flat_map(|grasp| &grasp.joints) {
                        let pose = joint.client_from_joint.expect("every joint has a pose");
                        let position = pose.position.expect("every pose has a position");
                        prop_assert!(
                            position.x.is_finite() && position.y.is_finite() && position.z.is_finite()
                        );
                    }
                }
                Err(error) => prop_assert!(matches!(error, ServiceError::Invalid(_)), "{}", error),
            }
            Ok(())
        });
        outcome.unwrap_or_else(|failure| panic!("{failure}"));
        // The test is meaningful only if many requests of every kind pass validation.
        assert!(searched.get().iter().all(|&count| count >= 20), "{searched:?}");
    }
}
