//! Checks `FindGraspRequest`.

use std::time::Duration;

use glam::Vec3;
use grasp_assets::hands::Hand;
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::{
        bend_ratios::BendRatioChoice,
        constraints::Constraints,
        strategy::{Choice, Strategy, Validity},
    },
};

use super::{
    Field, GiverHand, Violations, constraints::constraints, friction, hand, known, object_id_of, pose,
};
use crate::{convention::Convention, error::ServiceError};

/// The receiving hand of chapter 5, which the thesis' placement measures are made for.
const THESIS_RIG: &str = "thesis";

/// Attempts beyond this index are not run; at a million a second it takes 146,000 years to get here.
const LAST_ATTEMPT: u64 = (1 << 62) - 1;

/// Seconds that a `google.protobuf.Duration` may have: 10,000 years.
const LONGEST_DURATION_SECONDS: u64 = 315_576_000_000;

/// How long the best grasp is searched for if the request does not say: a character that turns to it within a frame of
/// 60 Hz leaves a third of the 16 ms for it. Longer finds better grasps, later. Where there is none by then, the first one is
/// looked for on.
const BEST_CHOICE_BUDGET: Duration = Duration::from_millis(5);

/// A request that may be searched.
#[derive(Debug)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "the request's switches do not hang together"
)]
pub(crate) struct FindQuery {
    /// The last part of the object's name.
    pub object_id: String,
    /// How poses were sent and are to be answered.
    pub convention: Convention,
    /// The object in the client's frame, in `OpenXR` axes.
    pub client_from_object: Pose,
    /// The giver's hand.
    pub presenting_hand: Option<GiverHand>,
    /// The hand to pose.
    pub receiving_hand: &'static Hand,
    /// Against gravity in the client's frame, in `OpenXR` axes: a unit vector.
    pub up: Vec3,
    /// The budget that was asked for.
    pub budget: Option<Duration>,
    /// Is the first grasp looked for on where the budget ends without any? It is if the request leaves open how long the best
    /// is looked for.
    pub goes_on: bool,
    /// The first attempt to run.
    pub first_attempt: u64,
    /// How many attempts to run at most.
    pub max_attempts: u64,
    /// The step of the ladder.
    pub strategy: Strategy,
    /// Which grasps count as valid.
    pub validity: Validity,
    /// The bend ratios.
    pub bend_ratios: BendRatioChoice,
    /// The seed that was asked for.
    pub seed: Option<u64>,
    /// Is the valid attempt of the lowest index wanted?
    pub reproducible: bool,
    /// Are the times of the steps wanted?
    pub record_step_times: bool,
    /// Friction for this request.
    pub friction: Option<f32>,
    /// What is demanded of the grasp, in the client's frame and `OpenXR` axes.
    pub constraints: Constraints,
    /// Which of the valid grasps is wanted.
    pub choice: Choice,
    /// May the atlas be used?
    pub may_use_atlas: bool,
    /// Is one attempt to be run again?
    pub is_replay: bool,
    /// Is the way to the grasp wanted?
    pub plan_key_frames: bool,
}

/// Checks a request. `object_exists` tells whether an id is known; an unknown one beside other violations is listed
/// with them, alone it is left to the look-up that follows.
///
/// # Errors
/// [`ServiceError::Invalid`] with every violation.
pub(crate) fn find_query(
    request: v1::FindGraspRequest,
    default_rig: &str,
    object_exists: impl Fn(&str) -> bool,
) -> Result<FindQuery, ServiceError> {
    let mut violations = Violations::default();
    let v = &mut violations;
    let convention = Convention::from_wire(known(Field::root("convention"), request.convention, v));
    let object_id = object_id_of(Field::root("object"), &request.object, v);
    let client_from_object = pose(
        Field::root("client_from_object"),
        request.client_from_object,
        convention.metres_per_unit(),
        v,
    );
    let presenting_hand = request
        .presenting_hand
        .and_then(|sent| hand::presenting_hand(Field::root("presenting_hand"), sent, convention, v));
    let validity = validity(known(Field::root("validity"), request.validity, v));
    let default_rig = match validity {
        Validity::Thesis => THESIS_RIG,
        Validity::Physical => default_rig,
    };
    let receiving_hand = hand::receiving_hand(
        Field::root("receiving_hand"),
        request.receiving_hand,
        default_rig,
        v,
    );
    let up = hand::up(Field::root("up"), request.up, convention, v);
    let choice = choice(known(Field::root("choice"), request.choice, v));
    let goes_on = choice == Choice::BestWithinBudget && request.budget.is_none();
    let budget = match request.budget {
        Some(budget) => positive_duration(Field::root("budget"), budget, v),
        None => goes_on.then_some(BEST_CHOICE_BUDGET),
    };
    let (first_attempt, max_attempts) = attempts(request.max_attempts, request.only_attempt, v);
    let strategy = strategy(known(Field::root("strategy"), request.strategy, v), validity);
    let bend_ratios = bend_ratios(
        known(Field::root("bend_ratios"), request.bend_ratios, v),
        strategy,
    );
    let friction = request
        .friction
        .map(|value| friction(Field::root("friction"), value, v));
    let constraints = constraints(Field::root("constraints"), request.constraints, convention, v);
    let atlas_use: v1::AtlasUse = known(Field::root("atlas"), request.atlas, v);
    if request.reproducible && choice == Choice::BestWithinBudget {
        v.add(
            Field::root("reproducible"),
            "is true with CHOICE_BEST_WITHIN_BUDGET, whose answer hangs on how much fits into the budget; choose one of both",
        );
    }
    if let (false, Some(id)) = (violations.is_empty(), &object_id)
        && !object_exists(id)
    {
        violations.add(Field::root("object"), format_args!("objects/{id} does not exist"));
    }
    let (Some(object_id), Some(receiving_hand)) = (object_id, receiving_hand) else {
        // Whatever is missing was reported by the function that returned nothing.
        return Err(violations.into_error());
    };
    violations.finish(FindQuery {
        object_id,
        convention,
        client_from_object: convention.pose_to_openxr(client_from_object),
        presenting_hand,
        receiving_hand,
        up,
        budget,
        goes_on,
        first_attempt,
        max_attempts,
        strategy,
        validity,
        bend_ratios,
        seed: request.seed,
        reproducible: request.reproducible,
        record_step_times: request.record_step_times,
        friction,
        constraints,
        choice,
        // A replayed attempt is to be that attempt.
        may_use_atlas: atlas_use != v1::AtlasUse::None,
        is_replay: request.only_attempt.is_some(),
        plan_key_frames: request.plan_key_frames,
    })
}

/// The first attempt and how many.
fn attempts(max_attempts: Option<u64>, only_attempt: Option<u64>, violations: &mut Violations) -> (u64, u64) {
    if max_attempts == Some(0) {
        violations.add(Field::root("max_attempts"), "is 0; at least 1 is needed");
    }
    match only_attempt {
        Some(only) => {
            if only > LAST_ATTEMPT {
                violations.add(
                    Field::root("only_attempt"),
                    format_args!("is {only}; it must be at most {LAST_ATTEMPT}"),
                );
            }
            (only, 1)
        }
        None => (0, max_attempts.unwrap_or(LAST_ATTEMPT).min(LAST_ATTEMPT)),
    }
}

fn positive_duration(
    field: Field<'_>,
    sent: prost_types::Duration,
    violations: &mut Violations,
) -> Option<Duration> {
    let text = || format!("{} s and {} ns", sent.seconds, sent.nanos);
    let in_range =
        sent.seconds.unsigned_abs() <= LONGEST_DURATION_SECONDS && sent.nanos.unsigned_abs() < 1_000_000_000;
    let one_sign = i64::from(sent.nanos.signum()) * sent.seconds.signum() >= 0;
    if !in_range || !one_sign {
        violations.add(
            field,
            format_args!("is {}, which is no valid google.protobuf.Duration", text()),
        );
        return None;
    }
    match (u64::try_from(sent.seconds), u32::try_from(sent.nanos)) {
        (Ok(seconds), Ok(nanos)) if seconds > 0 || nanos > 0 => Some(Duration::new(seconds, nanos)),
        _ => {
            violations.add(field, format_args!("is {}; it must be more than 0", text()));
            None
        }
    }
}

/// The server's default is what a user should get.
fn validity(validity: v1::Validity) -> Validity {
    match validity {
        v1::Validity::Thesis => Validity::Thesis,
        v1::Validity::Unspecified | v1::Validity::Physical => Validity::Physical,
    }
}

fn choice(choice: v1::Choice) -> Choice {
    match choice {
        v1::Choice::Unspecified | v1::Choice::FirstValid => Choice::FirstValid,
        v1::Choice::BestWithinBudget => Choice::BestWithinBudget,
    }
}

/// The server's default is the fastest strategy; with the thesis' validity, the fastest of its ladder.
fn strategy(strategy: v1::Strategy, validity: Validity) -> Strategy {
    match strategy {
        v1::Strategy::A => Strategy::A,
        v1::Strategy::B => Strategy::B,
        v1::Strategy::C => Strategy::C,
        v1::Strategy::D => Strategy::D,
        v1::Strategy::E => Strategy::E,
        v1::Strategy::F => Strategy::F,
        v1::Strategy::Guided => Strategy::Guided,
        v1::Strategy::Unspecified => match validity {
            Validity::Thesis => Strategy::F,
            Validity::Physical => Strategy::Guided,
        },
    }
}

fn bend_ratios(choice: v1::BendRatios, strategy: Strategy) -> BendRatioChoice {
    match choice {
        v1::BendRatios::Unspecified => strategy.default_bend_ratios(),
        v1::BendRatios::All => BendRatioChoice::All,
        v1::BendRatios::AllFingersWithoutLow => BendRatioChoice::AllFingersWithoutLow,
        v1::BendRatios::OneRandom => BendRatioChoice::OneRandom,
        v1::BendRatios::OneRandomFingersWithoutLow => BendRatioChoice::OneRandomFingersWithoutLow,
        v1::BendRatios::OnlyOne => BendRatioChoice::OnlyOne,
        v1::BendRatios::OnlyHigh => BendRatioChoice::OnlyHigh,
    }
}
