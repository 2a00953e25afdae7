//! Checks `FindGraspRequest`.

use std::sync::Arc;

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::{
        bend_ratios::BendRatioChoice,
        constraints::Constraints,
        hand::{Handedness, joints::HandJoints},
        obstacle::Obstacle,
        strategy::{Choice, Strategy, Validity},
    },
};

use super::{
    Field, GiverHand, Violations,
    constraints::{check_has_digits, constraints},
    friction, hand, known, object_id_of,
    object_size::{RequestedSize, object_size},
    obstacles, pose,
    receiver::{Stances, Surroundings, stances},
    search_limits::{SearchLimits, search_limits},
    standing::{Asked, StandingQuery, standing},
};
use crate::{
    convention::Convention,
    error::ServiceError,
    rigs::{RigHand, store::RigStore},
};

/// A valid request.
#[derive(Clone, Debug)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "the request's switches are independent"
)]
pub(crate) struct FindQuery {
    /// The last part of the object's name.
    pub object_id: String,
    /// The size and mass at which the object is held out.
    pub object_size: RequestedSize,
    /// Convention of the request and the response.
    pub convention: Convention,
    /// Pose of the object in the client's frame, in `OpenXR` axes.
    pub client_from_object: Pose,
    /// The giver's hand.
    pub presenting_hand: Option<GiverHand>,
    /// Further hands to keep clear of, in the client's frame and `OpenXR` axes.
    pub other_hands: Vec<GiverHand>,
    /// Obstacles to keep clear of, in the client's frame and `OpenXR` axes.
    pub obstacles: Vec<Obstacle>,
    /// The hand to pose.
    pub receiving_hand: RigHand,
    /// The hand that may be posed in its place: the request leaves the choice to the search.
    pub alternative_hand: Option<RigHand>,
    /// The receiver's other hand, if both take the object.
    pub other_hand: Option<RigHand>,
    /// Where the receiver's arms may come from, in the client's frame and `OpenXR` axes.
    pub stances: Stances,
    /// Direction against gravity in the client's frame, in `OpenXR` axes: a unit vector.
    pub up: Vec3,
    /// Limits of time and attempts.
    pub limits: SearchLimits,
    /// Search strategy.
    pub strategy: Strategy,
    /// Notion of a valid grasp.
    pub validity: Validity,
    /// Bend ratios to try.
    pub bend_ratios: BendRatioChoice,
    /// Requested seed.
    pub seed: Option<u64>,
    /// True if the indices of the valid attempts must decide, not which was found first.
    pub reproducible: bool,
    /// True to report the times of the steps.
    pub record_step_times: bool,
    /// Friction in place of the object's.
    pub friction: Option<f32>,
    /// Constraints on the grasp, in the client's frame and `OpenXR` axes.
    pub constraints: Constraints,
    /// Which valid grasp to choose.
    pub choice: Choice,
    /// True unless the request excludes the atlas.
    pub allows_atlas: bool,
    /// True to run a single attempt again.
    pub is_replay: bool,
    /// True to plan the key frames of approach and closing.
    pub plan_key_frames: bool,
    /// The grasp to hold on to.
    pub standing: Option<StandingQuery>,
    /// Where other people's hands were in the last second of a track, in the object's frame.
    pub recent_hands: Arc<[Arc<HandJoints>]>,
}

impl FindQuery {
    /// True if the search uses known grips.
    pub(crate) fn uses_atlas(&self) -> bool {
        self.allows_atlas && self.uses_seeds()
    }

    /// True if a hand to keep clear of is a mesh.
    pub(crate) fn has_hand_mesh(&self) -> bool {
        let mut hands = self.presenting_hand.iter().chain(&self.other_hands);
        hands.any(|hand| matches!(hand, GiverHand::Meshed(_)))
    }

    /// Leaves no choice of the receiving hand: it is that of this side, if it may be.
    pub(crate) fn keep_hand(&mut self, side: Handedness) {
        if let Some(other) = self.alternative_hand.take()
            && other.hand.rig.handedness == side
        {
            self.receiving_hand = other;
        }
    }

    /// True if its attempts use what is known about the object or similar ones.
    pub(crate) fn uses_seeds(&self) -> bool {
        self.other_hand.is_none() && self.strategy.uses_known_grips(self.validity)
    }
}

/// A search for the best grasp cannot be reproducible.
fn check_reproducible(is_reproducible: bool, choice: Choice, violations: &mut Violations) {
    if is_reproducible && choice == Choice::BestWithinBudget {
        violations.add(
            Field::root("reproducible"),
            "is true with CHOICE_BEST_WITHIN_BUDGET, whose answer depends on the speed of the machine; use one of them",
        );
    }
}

/// The object's pose in `OpenXR` axes, and its origin unless the pose is wrong.
fn object_pose(
    sent: Option<v1::Pose>,
    convention: Convention,
    violations: &mut Violations,
) -> (Pose, Option<Vec3>) {
    let before = violations.len();
    let field = Field::root("client_from_object");
    let sent = pose(field, sent, convention.metres_per_unit(), violations);
    let client_from_object = convention.object_to_openxr(sent);
    let origin = (violations.len() == before).then_some(client_from_object.position);
    (client_from_object, origin)
}

/// Adds to other violations that the object does not exist.
fn check_exists(
    id: Option<&str>,
    object_exists: impl Fn(&str) -> bool,
    others_are_wrong: bool,
    violations: &mut Violations,
) {
    if let (true, Some(id)) = (others_are_wrong || !violations.is_empty(), id)
        && !object_exists(id)
    {
        violations.add(Field::root("object"), format_args!("objects/{id} does not exist"));
    }
}

/// A replay needs a hand: the attempts of left and right differ.
fn check_replay(only_attempt: Option<u64>, chooses_hand: bool, violations: &mut Violations) {
    if only_attempt.is_some() && chooses_hand {
        violations.add(
            Field::root("receiving_hand").child("handedness"),
            "is unspecified with only_attempt, which each hand has of its own; name the hand of the grasp to replay",
        );
    }
}

/// Checks a request. An id for which `object_exists` is false is a violation if there are others; without others, it is
/// left to the look-up, which knows about evicted objects.
///
/// # Errors
/// [`ServiceError::Invalid`] with every violation.
pub(crate) fn find_query(
    request: v1::FindGraspRequest,
    rigs: (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<FindQuery, ServiceError> {
    let mut violations = Violations::default();
    let query = checked_query(request, rigs, object_exists, false, &mut violations);
    finished(query, violations)
}

/// The value of a request, unless there are violations: then there may be none.
///
/// # Errors
/// [`ServiceError::Invalid`] with the violations.
pub(super) fn finished<T>(value: Option<T>, violations: Violations) -> Result<T, ServiceError> {
    match value {
        Some(value) => violations.finish(value),
        // The function that returned none has added a violation.
        None => Err(violations.into_error()),
    }
}

/// As [`find_query`], for a request inside another one, in which other fields may be wrong; none only with violations.
pub(super) fn checked_query(
    request: v1::FindGraspRequest,
    (default_rig, rigs): (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
    others_are_wrong: bool,
    v: &mut Violations,
) -> Option<FindQuery> {
    let convention = Convention::from_wire(known(Field::root("convention"), request.convention, v));
    let object_id = object_id_of(Field::root("object"), &request.object, v);
    let object_size = object_size(request.object_scale, request.object_mass_kg, v);
    let (client_from_object, object_origin) = object_pose(request.client_from_object, convention, v);
    let presenting_hand = request
        .presenting_hand
        .and_then(|sent| hand::presenting_hand(Field::root("presenting_hand"), sent, convention, rigs, v));
    let validity = validity(known(Field::root("validity"), request.validity, v));
    let (other_hands, obstacles) = barriers(
        (presenting_hand.as_ref(), request.other_hands, &request.obstacles),
        validity,
        (convention, rigs),
        v,
    );
    let (receiving_hands, is_named) = hand::receiving_hand(
        Field::root("receiving_hand"),
        request.receiving_hand,
        (validity, default_rig),
        rigs,
        v,
    );
    let up = hand::up(Field::root("up"), request.up, convention, v);
    let choice = choice(known(Field::root("choice"), request.choice, v));
    let limits = search_limits(
        request.budget,
        request.improvement,
        (request.max_attempts, request.only_attempt),
        choice,
        v,
    );
    let strategy = strategy(known(Field::root("strategy"), request.strategy, v), validity);
    let bend_ratios = bend_ratios(
        known(Field::root("bend_ratios"), request.bend_ratios, v),
        strategy,
    );
    let friction = request
        .friction
        .map(|value| friction(Field::root("friction"), value, v));
    let constraints = constraints(Field::root("constraints"), request.constraints, convention, v);
    check_has_digits(&constraints, receiving_hands.as_ref(), v);
    let atlas_use: v1::AtlasUse = known(Field::root("atlas"), request.atlas, v);
    check_reproducible(request.reproducible, choice, v);
    let takes_both_hands = takes_both_hands(
        known(Field::root("hands"), request.hands, v),
        (strategy, validity),
        request.plan_key_frames,
        v,
    );
    let chooses_hand = !is_named && !takes_both_hands && validity == Validity::Physical;
    check_replay(request.only_attempt, chooses_hand, v);
    let asked = Asked {
        convention,
        searched: (strategy, validity),
        takes_both_hands,
        is_replay: request.only_attempt.is_some(),
        hands: receiving_hands.as_ref(),
        chooses_hand,
    };
    let standing = standing(request.standing, &asked, rigs, v);
    let surroundings = Surroundings {
        convention,
        object: object_origin,
        validity,
        takes_both_hands,
        chooses_hand,
    };
    let stances = stances(request.receiver, request.receiver_stance, &surroundings, v);
    check_exists(object_id.as_deref(), object_exists, others_are_wrong, v);
    let (object_id, hands) = (object_id?, receiving_hands?);
    let other_hand = |is_posed: bool| is_posed.then(|| hands.other.clone());
    Some(FindQuery {
        object_id,
        object_size,
        convention,
        client_from_object,
        presenting_hand,
        other_hands,
        obstacles,
        alternative_hand: other_hand(chooses_hand),
        other_hand: other_hand(takes_both_hands),
        receiving_hand: hands.hand,
        stances,
        up,
        limits,
        strategy,
        validity,
        bend_ratios,
        seed: request.seed,
        reproducible: request.reproducible,
        record_step_times: request.record_step_times,
        friction,
        constraints,
        choice,
        allows_atlas: atlas_use != v1::AtlasUse::None,
        is_replay: request.only_attempt.is_some(),
        plan_key_frames: request.plan_key_frames,
        standing,
        recent_hands: Arc::default(),
    })
}

/// What to keep clear of besides the presenting hand.
fn barriers(
    (presenting, hands, sent): (Option<&GiverHand>, Vec<v1::PresentingHand>, &[v1::Obstacle]),
    validity: Validity,
    (convention, rigs): (Convention, &RigStore),
    violations: &mut Violations,
) -> (Vec<GiverHand>, Vec<Obstacle>) {
    let hands = obstacles::other_hands(
        Field::root("other_hands"),
        (presenting, hands),
        validity,
        (convention, rigs),
        violations,
    );
    let field = Field::root("obstacles");
    let obstacles = obstacles::obstacles(field, sent, validity, convention, violations);
    (hands, obstacles)
}

/// True if both hands take the object.
fn takes_both_hands(
    hands: v1::Hands,
    searched: (Strategy, Validity),
    plan_key_frames: bool,
    violations: &mut Violations,
) -> bool {
    match hands {
        v1::Hands::Unspecified | v1::Hands::One => return false,
        v1::Hands::Both => {}
    }
    if searched != (Strategy::Guided, Validity::Physical) {
        violations.add(
            Field::root("hands"),
            "is HANDS_BOTH, which requires VALIDITY_PHYSICAL and STRATEGY_GUIDED; use these or HANDS_ONE",
        );
    }
    if plan_key_frames {
        violations.add(
            Field::root("plan_key_frames"),
            "is true with HANDS_BOTH, for which no motion is planned; leave it out or use HANDS_ONE",
        );
    }
    true
}

/// The default is PHYSICAL.
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

/// The default is the fastest strategy for the validity.
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
