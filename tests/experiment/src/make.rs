//! Runs searches and single attempts, and examines how attempts end, how long their steps take, and the other data of the figures.

use std::time::{Duration, Instant};

use glam::Vec3;
use grasp_assets::{
    hands::hand,
    holdouts::{BuiltInHoldout, HoldoutError, holdouts},
};
use grasp_synthesis::{
    base::{
        clock::Clock,
        pose::Pose,
        random::AttemptStream,
        rejection::{Failure, Rejection},
        stop::Stop,
        stopwatch::Stopwatch,
    },
    model::{
        grasp::{Contact, Grasp},
        hand::{Digit, Handedness, rig::Rig},
        holdout::Holdout,
        strategy::Validity,
    },
    propose::prepared::PreparedRig,
    rating::scoring::comfort,
    search::{
        SearchReport,
        attempt::Attempt,
        find_grasp,
        scene::{Scene, Task},
        settings::{Query, Run, SearchSettings},
    },
    thesis::{
        finger_posing::{PosedDigit, close_digit, hand_motion},
        immobility_validation::{
            ACCEPTED_WRENCH_ANGLE_DEGREES, DISTRIBUTION_TRIES, ForceDistribution, Immobility,
            ImmobilityBuffers, Load, Wrench, contact_counts, four_unit_wrenches, printed_cone_cos,
        },
    },
};

use crate::{
    plan::{Cell, Set, Settings},
    run::Row,
};

/// The receiving hand under the thesis' validity: the server's default.
const RIG: &str = "thesis";

/// Why no grasps can be made.
#[derive(Debug, thiserror::Error)]
pub enum MakeError {
    /// A built-in holdout is broken.
    #[error("the built-in holdout {0} is broken")]
    Holdout(&'static str, #[source] HoldoutError),
    /// A built-in rig is missing.
    #[error("the rig {0:?} is not built in")]
    Rig(&'static str),
    /// The system provides no threads.
    #[error("cannot start {0} threads")]
    Threads(usize, #[source] rayon::ThreadPoolBuildError),
}

/// The machine's monotonic clock.
pub(crate) struct MonotonicClock(Instant);

impl Clock for MonotonicClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

/// A finished search.
pub(crate) struct Search {
    pub(crate) report: SearchReport,
    /// Wall-clock time.
    pub(crate) took: Duration,
}

/// Prepared holdouts, and threads to search them with.
pub(crate) struct Maker {
    pub(crate) holdouts: Vec<Holdout>,
    pub(crate) rig: &'static PreparedRig,
    pools: Vec<(usize, rayon::ThreadPool)>,
    pub(crate) clock: MonotonicClock,
}

impl Maker {
    pub(crate) fn new(settings: &Settings) -> Result<Self, MakeError> {
        let receiving_hand = hand(RIG, Handedness::Right).ok_or(MakeError::Rig(RIG))?;
        let ready = |holdout: &'static BuiltInHoldout| {
            holdout
                .to_holdout()
                .map_err(|error| MakeError::Holdout(&holdout.name, error))
        };
        let pool = |threads| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .map(|pool| (threads, pool))
                .map_err(|error| MakeError::Threads(threads, error))
        };
        Ok(Self {
            holdouts: holdouts().iter().map(ready).collect::<Result<_, _>>()?,
            rig: &receiving_hand.rig,
            pools: [1, settings.threads]
                .into_iter()
                .map(pool)
                .collect::<Result<_, _>>()?,
            clock: MonotonicClock(Instant::now()),
        })
    }

    /// Searches until there is a valid grasp: every built-in holdout leaves some.
    pub(crate) fn search(&self, cell: &Cell, seed: u64) -> Search {
        let settings = SearchSettings {
            query: query(cell.set),
            run: Run {
                seed,
                // On two threads the same attempt wins as on one.
                reproducible: true,
                workers: cell.threads,
                ..Run::default()
            },
            ..SearchSettings::default()
        };
        let (_, pool) = self
            .pools
            .iter()
            .find(|(threads, _)| *threads == cell.threads)
            .expect("a cell has one thread or the settings'");
        // From inside the pool, so that searches on one thread do not include waking it.
        pool.install(|| {
            let start = self.clock.now();
            let outcome = find_grasp(
                pool,
                &Scene::new(self.task(cell), &settings),
                &settings,
                &self.clock,
                Stop::NEVER,
            );
            Search {
                took: self.clock.now().saturating_sub(start),
                report: outcome.report,
            }
        })
    }

    pub(crate) fn scene(&self, cell: &Cell) -> Scene<'_> {
        let settings = SearchSettings {
            query: query(cell.set),
            ..SearchSettings::default()
        };
        Scene::new(self.task(cell), &settings)
    }

    fn task(&self, cell: &Cell) -> Task<'_> {
        Task {
            holdout: &self.holdouts[cell.holdout],
            object: cell.built_in().prepared_object(),
            rig: self.rig,
        }
    }
}

/// The query of a set's searches.
fn query(set: Set) -> Query {
    Query {
        strategy: set.strategy,
        validity: Validity::Thesis,
        bend_ratios: set.bend_ratios,
        ..Query::default()
    }
}

/// Runs per attempt for the median of its times: the first ones have cold caches, and other work interrupts some.
const REPLAYS: usize = 5;

/// Repetitions of Immobility Validation with new draws per valid grasp, to see how much of E is due to the draw. More
/// give a better estimate and longer rows.
const COMFORT_REPEATS: u64 = 8;

/// Added to a seed for draws after a grasp was found, so that they are independent of the search. Any number far from
/// other seeds works.
const SEED_OF_AFTERTHOUGHTS: u64 = 1 << 60;

/// An examined attempt.
pub(crate) struct Examined {
    end: Result<Box<Grasp>, Failure>,
    /// `None` where guided search found no place.
    measures: Option<PlacementMeasures>,
    /// Thumb first.
    digits: Vec<DigitFigures>,
    /// Median time of each step of Algorithm 1 over some replays, in nanoseconds.
    step_nanoseconds: [u64; 5],
    drawn: Option<DrawnFigures>,
}

/// The measures of a wrist placement (5.3), in metres and degrees.
struct PlacementMeasures {
    wrist_distance: f32,
    palm_distance: f32,
    upward_degrees: f32,
    forward_degrees: f32,
    /// `None` without a giver, or if a palm is straight above or below the centre of mass.
    palm_com_palm_degrees: Option<f32>,
}

impl PlacementMeasures {
    fn of(holdout: &Holdout, rig: &Rig, wrist: Pose) -> Self {
        let object = &holdout.object;
        let closest = |point: Vec3| {
            let closest = object.surface.closest_point_within(point, f32::INFINITY);
            closest.map_or((point, f32::INFINITY), |closest| {
                (closest.position, closest.distance)
            })
        };
        let palm = wrist.transform_point(rig.palm);
        let (closest_to_palm, palm_distance) = closest(palm);
        let to_object = closest_to_palm - wrist.position;
        let angle = |a: Vec3, b: Vec3| a.cross(b).length().atan2(a.dot(b)).to_degrees();
        let on_ground = |point: Vec3| {
            let arm = point - object.centre_of_mass;
            arm - holdout.up * arm.dot(holdout.up)
        };
        let giver = holdout.presenting_hand.as_ref();
        let palms = giver.map(|giver| [giver.palm, palm].map(on_ground));
        let palms = palms.filter(|palms| !palms.contains(&Vec3::ZERO));
        Self {
            wrist_distance: closest(wrist.position).1,
            palm_distance,
            upward_degrees: angle(wrist.transform_vector(Vec3::Y), to_object),
            forward_degrees: angle(wrist.transform_vector(Vec3::Z), to_object),
            palm_com_palm_degrees: palms.map(|[giver, receiver]| angle(giver, receiver)),
        }
    }
}

/// A posed digit.
struct DigitFigures {
    yaw_degrees: f32,
    bend_degrees: f32,
    /// The ratio with which it touches, if it does.
    bend_ratio: Option<f32>,
    /// Links that touch.
    contacts: usize,
    /// For a touching digit of a valid grasp: whether it touches with 0.7, 1 and 1.42 alone, at the same wrist and yaw
    /// (Figure 5.19).
    touches_with: Option<[bool; 3]>,
}

/// Figures of a valid grasp from new draws of force distributions.
struct DrawnFigures {
    /// How many of 100 distributions oppose gravity (5.6).
    sufficient_distributions: usize,
    /// E of those of [`COMFORT_REPEATS`] repetitions of Immobility Validation that passed.
    comfort_again: Vec<f32>,
}

impl Maker {
    /// Examines an attempt of a cell.
    pub(crate) fn examine(&self, cell: &Cell, seed: u64, index: u64) -> Examined {
        let scene = self.scene(cell);
        let mut attempt = Attempt::default();
        let mut times = Vec::with_capacity(REPLAYS);
        let mut end = Err(Failure::Stopped);
        for _ in 0..REPLAYS {
            let mut stopwatch = Stopwatch::new(&self.clock);
            let mut stream = AttemptStream::new(seed, index);
            end = attempt.run(&scene, &mut stream, &mut stopwatch, Stop::NEVER);
            times.extend(stopwatch.times());
        }
        let valid = end.as_ref().ok();
        let wrist = match (&end, valid) {
            (_, Some(grasp)) => Some(grasp.pose.frame_from_wrist),
            // Guided search had no proposal.
            (Err(Failure::Rejected { rejection, .. }), _)
                if *rejection == Rejection::NoContacts && attempt.is_unposed() =>
            {
                None
            }
            _ => Some(attempt.wrist().object_from_wrist),
        };
        let holdout = &self.holdouts[cell.holdout];
        let steps: [Duration; 5] = std::array::from_fn(|step| median(times.iter().map(|times| times[step])));
        Examined {
            measures: wrist.map(|wrist| PlacementMeasures::of(holdout, self.rig, wrist)),
            digits: self.posed_digits(cell, &attempt, valid.is_some()),
            step_nanoseconds: steps.map(nanoseconds),
            drawn: valid.map(|grasp| self.draw_again(cell, grasp, seed, index)),
            end,
        }
    }

    /// The digits of an attempt.
    fn posed_digits(&self, cell: &Cell, attempt: &Attempt, is_valid: bool) -> Vec<DigitFigures> {
        let object = &self.holdouts[cell.holdout].object;
        let motions = hand_motion(self.rig);
        let touches_with = |digit: usize, posed: &PosedDigit| {
            // Figure 5.19: with the same wrist and yaw, the digit closes with each ratio alone.
            std::array::from_fn(|ratio| {
                let yaw = posed.angles.base_yaw;
                close_digit(object, attempt.wrist(), &motions[digit], yaw, &[ratio]).touches()
            })
        };
        let digits = attempt.posed_digits().iter().enumerate();
        digits
            .map(|(digit, posed)| DigitFigures {
                yaw_degrees: posed.angles.base_yaw.to_degrees(),
                bend_degrees: posed.angles.base_pitch.to_degrees(),
                bend_ratio: posed.bend_ratio,
                contacts: posed.hits.iter().flatten().count(),
                touches_with: (is_valid && posed.touches()).then(|| touches_with(digit, posed)),
            })
            .collect()
    }

    /// Draws new force distributions for the contacts of a grasp.
    fn draw_again(&self, cell: &Cell, grasp: &Grasp, seed: u64, index: u64) -> DrawnFigures {
        let contacts = &grasp.contacts;
        let holdout = &self.holdouts[cell.holdout];
        let load = Load {
            gravity: Wrench::of_gravity(holdout.object.mass, holdout.up),
            centre_of_mass: holdout.object.centre_of_mass,
            friction: holdout.object.friction_under(Validity::Thesis),
        };
        let takes_first = cell.set.strategy.takes_first_force_distribution();
        let stream_of = |draw: u64| {
            AttemptStream::new(seed.wrapping_add(SEED_OF_AFTERTHOUGHTS).wrapping_add(draw), index)
        };
        let mut buffers = ImmobilityBuffers::default();
        let comfort_again = (1..=COMFORT_REPEATS)
            .filter_map(|draw| {
                let end = buffers.validate(contacts, &load, takes_first, &mut stream_of(draw), Stop::NEVER);
                match end {
                    Ok(Immobility::Immobilizing(_)) => Some(comfort(buffers.digit_totals(contacts))),
                    Ok(Immobility::NotImmobilizing(_)) | Err(_) => None,
                }
            })
            .collect();
        DrawnFigures {
            sufficient_distributions: count_sufficient(contacts, &load, &mut stream_of(0)),
            comfort_again,
        }
    }
}

/// How many of 100 random force distributions oppose gravity within the accepted angle.
fn count_sufficient(contacts: &[Contact], load: &Load, stream: &mut AttemptStream) -> usize {
    let cone_cos = printed_cone_cos(load.friction);
    let unit_wrenches: Vec<_> = contacts
        .iter()
        .map(|contact| four_unit_wrenches(contact, load.centre_of_mass, cone_cos))
        .collect();
    let counts = contact_counts(contacts);
    let accepted = ACCEPTED_WRENCH_ANGLE_DEGREES.to_radians().cos();
    let mut distribution = ForceDistribution::default();
    let suffices = |_: &usize| {
        distribution.sample(contacts, counts, stream);
        let wrench = distribution.summed_wrench(&unit_wrenches);
        wrench.cos_angle(load.gravity * -1.0) > accepted
    };
    (0..DISTRIBUTION_TRIES).filter(suffices).count()
}

impl Examined {
    /// True for a valid grasp.
    pub(crate) fn is_valid(&self) -> bool {
        self.end.is_ok()
    }

    /// Adds the columns of `attempts.csv` that follow the attempt's origin.
    pub(crate) fn add_to(&self, row: &mut Row) {
        let grasp = self.end.as_ref().ok();
        row.add("output_type", self.output_type());
        let measures = self.measures.as_ref();
        row.add_known(
            "wrist_distance_cm",
            measures.map(|measures| measures.wrist_distance * 100.0),
        );
        row.add_known(
            "palm_distance_cm",
            measures.map(|measures| measures.palm_distance * 100.0),
        );
        row.add_known(
            "upward_wrist_angle_degrees",
            measures.map(|measures| measures.upward_degrees),
        );
        row.add_known(
            "forward_wrist_angle_degrees",
            measures.map(|measures| measures.forward_degrees),
        );
        row.add_known(
            "palm_com_palm_angle_degrees",
            measures.and_then(|measures| measures.palm_com_palm_degrees),
        );
        for digit in Digit::ALL {
            let name = format!("{digit:?}").to_lowercase();
            let posed = self.digits.get(digit.index());
            let touches_with = posed.and_then(|posed| posed.touches_with);
            let flags = touches_with.map(|touches| touches.map(|it| if it { "y" } else { "n" }).concat());
            row.add_known(
                format!("{name}_yaw_degrees"),
                posed.map(|posed| posed.yaw_degrees),
            );
            row.add_known(
                format!("{name}_bend_degrees"),
                posed.map(|posed| posed.bend_degrees),
            );
            row.add_known(
                format!("{name}_bend_ratio"),
                posed.and_then(|posed| posed.bend_ratio),
            );
            row.add_known(format!("{name}_contacts"), posed.map(|posed| posed.contacts));
            row.add_known(format!("{name}_touches_with"), flags);
        }
        for (step, time) in [
            "wrist_placement",
            "finger_posing",
            "collision_validation",
            "contact_validation",
            "immobility_validation",
        ]
        .into_iter()
        .zip(self.step_nanoseconds)
        {
            row.add(format!("{step}_ns"), time);
        }
        row.add_known(
            "grasp_type",
            grasp.and_then(|grasp| Some(grasp.classification.grasp_type?.name())),
        );
        row.add_known(
            "wrench_angle_degrees",
            grasp.map(|grasp| grasp.wrench_angle.to_degrees()),
        );
        row.add_known("comfort", grasp.map(|grasp| grasp.comfort));
        let drawn = self.drawn.as_ref();
        row.add_known(
            "sufficient_distributions",
            drawn.map(|drawn| drawn.sufficient_distributions),
        );
        for draw in 0..COMFORT_REPEATS as usize {
            let again = drawn.and_then(|drawn| drawn.comfort_again.get(draw));
            row.add_known(format!("comfort_again_{draw}"), again);
        }
    }

    /// The output type as Table 5.2 spells it.
    fn output_type(&self) -> &'static str {
        match &self.end {
            Ok(_) => "Valid",
            Err(Failure::Rejected { rejection, .. }) => type_of(*rejection),
            Err(Failure::Stopped) => "Interrupted",
        }
    }
}

/// The name of a rejection in the style of Table 5.2.
pub(crate) fn type_of(rejection: Rejection) -> &'static str {
    match rejection {
        Rejection::NoContacts => "NoContacts",
        Rejection::NoThumb => "NoThumb",
        Rejection::NoThumbEarlyStop => "NoThumbEarlystop",
        Rejection::NoFingers => "NoFingers",
        Rejection::PalmCollision => "PalmCollision",
        Rejection::FingerCollision => "FingerCollision",
        Rejection::UnwantedContact => "UnwantedContact",
        Rejection::NotImmobilizing => "NotImmobilizing",
        Rejection::UnmetRequirement => "UnmetRequirement",
    }
}

fn median(values: impl Iterator<Item = Duration>) -> Duration {
    let mut sorted: Vec<_> = values.collect();
    sorted.sort_unstable();
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

/// A duration in nanoseconds, saturating at 584 years.
pub(crate) fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
