//! Details of one attempt, or of one grip of an atlas.

use grasp_synthesis::{
    base::{
        pose::Pose,
        random::AttemptStream,
        rejection::{Failure, Rejection},
        stop::Stop,
        stopwatch::Stopwatch,
    },
    model::{
        grasp::{Contact, Grasp},
        hand::{Digit, HandPart},
        strategy::Validity,
    },
    rating::comfort::comfort,
    search::attempt::Attempt,
    thesis::{
        closing_motion::hand_motion,
        finger_posing::{PosedDigit, close_digit},
        force_distribution::{ForceDistribution, contact_counts},
        immobility_validation::{
            ACCEPTED_WRENCH_ANGLE_DEGREES, DISTRIBUTION_TRIES, DistributionChoice, Immobility,
            ImmobilityBuffers, Load,
        },
        placement_measures::PlacementMeasures,
        wrenches::{Wrench, four_unit_wrenches, printed_cone_cos},
    },
};

use super::{Maker, nanoseconds};
use crate::{
    plan::Cell,
    record::{Details, DigitFigures, GraspFigures, Measures, Source},
};

/// Runs per attempt for the median of its times: the first ones have cold caches, and other work interrupts some.
const REPLAYS: usize = 5;

/// Repetitions of Immobility Validation with new draws per valid grasp, to see how much of E is due to the draw. More
/// give a better estimate and longer records.
pub(crate) const COMFORT_REPEATS: u64 = 8;

/// Added to a seed for draws after a grasp was found, so that they are independent of the search. Any number far from
/// other seeds works.
const SEED_OF_AFTERTHOUGHTS: u64 = 1 << 60;

/// An examined attempt or grip.
pub(super) struct Closer {
    pub(super) end: Result<Box<Grasp>, Failure>,
    pub(super) details: Details,
}

impl Maker {
    /// Details of an attempt or a grip; none if it does not exist, or if the grip does not hold.
    pub(super) fn examine(&self, cell: &Cell, seed: u64, source: Source) -> Option<Closer> {
        match source {
            Source::Attempt(index) => Some(self.look_at_attempt(cell, seed, index)),
            Source::AtlasEntry(entry) => {
                let grasp = self.grip(cell, entry)?;
                let details = Details {
                    measures: Some(self.measures(cell, grasp.pose.frame_from_wrist)),
                    digits: held_digits(&grasp),
                    step_nanoseconds: None,
                    grasp: Some(solved_figures(&grasp)),
                };
                let end = Ok(grasp);
                Some(Closer { end, details })
            }
            Source::Nowhere => None,
        }
    }

    /// Details of an attempt, with times from repeated runs.
    pub(super) fn look_at_attempt(&self, cell: &Cell, seed: u64, index: u64) -> Closer {
        let scene = self.scene(cell);
        let mut attempt = Attempt::default();
        let mut times = Vec::with_capacity(REPLAYS);
        let mut end = Err(Failure::Stopped);
        for _ in 0..REPLAYS {
            let mut stopwatch = Stopwatch::new(&self.clock);
            let mut stream = AttemptStream::new(seed, index);
            end = attempt.run(&scene, &mut stream, &mut stopwatch, Stop::NEVER);
            times.extend(stopwatch.times().map(|times| times.map(nanoseconds)));
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
        let is_of_thesis = cell.set.validity == Validity::Thesis;
        let details = Details {
            measures: wrist.map(|wrist| self.measures(cell, wrist)),
            digits: match valid {
                _ if is_of_thesis => self.posed_digits(cell, &attempt, valid.is_some()),
                Some(grasp) => held_digits(grasp),
                None => Vec::new(),
            },
            step_nanoseconds: Some(std::array::from_fn(|step| {
                median(times.iter().map(|times| times[step]))
            })),
            grasp: valid.map(|grasp| {
                if is_of_thesis {
                    self.drawn_figures(cell, grasp, seed, index)
                } else {
                    solved_figures(grasp)
                }
            }),
        };
        Closer { end, details }
    }

    fn measures(&self, cell: &Cell, object_from_wrist: Pose) -> Measures {
        let holdout = &self.holdouts[cell.holdout];
        PlacementMeasures::of(holdout, self.rig(cell.set), object_from_wrist).into()
    }

    /// The digits of an attempt under the thesis' validity.
    fn posed_digits(&self, cell: &Cell, attempt: &Attempt, is_valid: bool) -> Vec<DigitFigures> {
        let object = &self.holdouts[cell.holdout].object;
        let motions = hand_motion(self.rig(cell.set));
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
                contacts: posed.hits.iter().flatten().count() as u32,
                touches_with: (is_valid && posed.touches()).then(|| touches_with(digit, posed)),
            })
            .collect()
    }

    /// Figures of a grasp under the thesis' validity, with new force distributions for its contacts.
    fn drawn_figures(&self, cell: &Cell, grasp: &Grasp, seed: u64, index: u64) -> GraspFigures {
        let contacts = &grasp.contacts;
        let holdout = &self.holdouts[cell.holdout];
        let load = Load {
            gravity: Wrench::of_gravity(holdout.object.mass, holdout.up),
            centre_of_mass: holdout.object.centre_of_mass,
            friction: holdout.object.friction_under(Validity::Thesis),
        };
        let choice = if cell.set.strategy.takes_first_force_distribution() {
            DistributionChoice::FirstSufficient
        } else {
            DistributionChoice::Best
        };
        let stream_of = |draw: u64| {
            AttemptStream::new(seed.wrapping_add(SEED_OF_AFTERTHOUGHTS).wrapping_add(draw), index)
        };
        let mut buffers = ImmobilityBuffers::default();
        let comfort_again = (1..=COMFORT_REPEATS)
            .filter_map(|draw| {
                let end = buffers.validate(contacts, &load, choice, &mut stream_of(draw), Stop::NEVER);
                match end {
                    Ok(Immobility::Immobilizing(_)) => Some(comfort(buffers.digit_totals(contacts))),
                    Ok(Immobility::NotImmobilizing(_)) | Err(_) => None,
                }
            })
            .collect();
        GraspFigures {
            wrench_angle_degrees: grasp.wrench_angle.to_degrees(),
            comfort: grasp.comfort,
            sufficient_distributions: Some(count_sufficient(contacts, &load, &mut stream_of(0))),
            comfort_again,
            palm_contacts: 0,
        }
    }
}

/// Figures of a grasp with solved forces.
fn solved_figures(grasp: &Grasp) -> GraspFigures {
    GraspFigures {
        wrench_angle_degrees: grasp.wrench_angle.to_degrees(),
        comfort: grasp.comfort,
        sufficient_distributions: None,
        comfort_again: Vec::new(),
        palm_contacts: count_contacts(grasp, |part| part == HandPart::Palm),
    }
}

/// The digits of a grasp under `PHYSICAL` validity.
fn held_digits(grasp: &Grasp) -> Vec<DigitFigures> {
    let figures = |digit: Digit| {
        let angles = &grasp.pose.digits[digit.index()];
        DigitFigures {
            yaw_degrees: angles.base_yaw.to_degrees(),
            bend_degrees: angles.base_pitch.to_degrees(),
            bend_ratio: grasp.bend_ratios[digit.index()],
            contacts: count_contacts(grasp, |part| part.digit() == Some(digit)),
            touches_with: None,
        }
    };
    Digit::ALL.map(figures).to_vec()
}

fn count_contacts(grasp: &Grasp, is_counted: impl Fn(HandPart) -> bool) -> u32 {
    let parts = grasp.contacts.iter().map(|contact| contact.part);
    parts.filter(|part| is_counted(*part)).count() as u32
}

/// How many of 100 random force distributions oppose gravity within the accepted angle.
fn count_sufficient(contacts: &[Contact], load: &Load, stream: &mut AttemptStream) -> u32 {
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
    (0..DISTRIBUTION_TRIES).filter(suffices).count() as u32
}

fn median(values: impl Iterator<Item = u64>) -> u64 {
    let mut sorted: Vec<_> = values.collect();
    sorted.sort_unstable();
    sorted.get(sorted.len() / 2).copied().unwrap_or(0)
}
