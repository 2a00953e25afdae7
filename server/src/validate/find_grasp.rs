//! Checks `FindGraspRequest`.

use std::sync::Arc;

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::{
        hand::{Handedness, joints::HandJoints},
        holdout::Obstacle,
        requirements::Requirements,
        strategy::{BendRatioChoice, Choice, Strategy, Validity},
    },
};

use super::{
    Field, GiverHand, Violations,
    current_grasp::{Context, CurrentGraspQuery, current_grasp},
    frames::{Frames, output},
    holdout::{RequestedSize, holdout},
    receiver::{Receiver, Stances, receiver},
    required,
    requirements::{Thesis, check_has_digits, requirements, validity},
    search::{SearchLimits, search},
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
    /// Obstacles to keep clear of, in the client's frame and `OpenXR` axes. A long tube is several.
    pub obstacles: Vec<Obstacle>,
    /// The place in the request of each of them.
    pub obstacle_places: Vec<usize>,
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
    pub limits: SearchLimits,
    pub strategy: Strategy,
    pub validity: Validity,
    pub bend_ratios: BendRatioChoice,
    pub seed: Option<u64>,
    /// True if the indices of the valid attempts must decide, not which was found first.
    pub reproducible: bool,
    /// True to report the times of the steps.
    pub record_step_times: bool,
    /// Friction in place of the object's.
    pub friction: Option<f32>,
    /// Requirements on the grasp, in the client's frame and `OpenXR` axes, without the receiver's reach.
    pub requirements: Requirements,
    /// Which valid grasp to choose.
    pub choice: Choice,
    /// True unless the request excludes the atlas.
    pub allows_atlas: bool,
    /// True to run a single attempt again.
    pub is_replay: bool,
    /// True to plan the key frames of approach and closing.
    pub plan_key_frames: bool,
    /// True to answer only what changed of a grasp that is kept.
    pub changes_only: bool,
    /// The grasp to hold on to.
    pub current: Option<CurrentGraspQuery>,
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

/// Checks a request. An id for which `object_exists` is false is a violation if there are others; without others, it is
/// left to the look-up, which knows about evicted objects.
pub(crate) fn find_query(
    request: v1::FindGraspRequest,
    rigs: (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<FindQuery, ServiceError> {
    let violations = Violations::default();
    let query = checked_query(request, rigs, object_exists, &violations);
    finished(query, violations)
}

/// The value of a request, unless there are violations: then there may be none.
pub(super) fn finished<T>(value: Option<T>, violations: Violations) -> Result<T, ServiceError> {
    match value {
        Some(value) => violations.finish(value),
        // The function that returned none has added a violation.
        None => Err(violations.into_error()),
    }
}

/// The query of a request, or of the parts of another one that both have; `None` only with violations.
pub(super) fn checked_query(
    request: v1::FindGraspRequest,
    (default_rig, rigs): (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
    v: &Violations,
) -> Option<FindQuery> {
    let output = output(v.field("output"), request.output);
    let validity = validity(request.requirements.as_ref());
    let convention = output.convention;
    let holdout_field = v.field("holdout");
    let holdout = required(holdout_field, request.holdout)
        .map(|sent| holdout(holdout_field, sent, validity, (convention, rigs)));
    let receiver_field = v.field("receiver");
    let origin = holdout.as_ref().and_then(|holdout| holdout.origin);
    let receiver = receiver(
        receiver_field,
        request.receiver,
        (convention, origin, validity),
        (default_rig, rigs),
    );
    let requirements_field = v.field("requirements");
    let requirements = requirements(requirements_field, request.requirements, convention);
    check_has_digits(
        requirements_field,
        &requirements.requirements,
        receiver.hands.as_ref(),
    );
    if receiver.takes_both_hands {
        check_both_hands(receiver_field, requirements.thesis, output.plan_key_frames);
    }
    let search = search(v.field("search"), request.search);
    check_replay(receiver_field, search.is_replay, &receiver);
    let client_from_object = holdout
        .as_ref()
        .map_or(Pose::IDENTITY, |holdout| holdout.client_from_object);
    let context = Context {
        frames: Frames {
            convention,
            client_from_object,
            rigs,
        },
        searched: (requirements.thesis.strategy, validity),
        takes_both_hands: receiver.takes_both_hands,
        is_replay: search.is_replay,
        receiving_hand: receiver.hands.as_ref().map(|hands| &hands.hand),
        chooses_hand: receiver.chooses_hand,
    };
    let current = current_grasp(v.field("current"), request.current, &context);
    let holdout = holdout?;
    check_exists(holdout_field, holdout.object_id.as_deref(), object_exists);
    let (object_id, hands) = (holdout.object_id?, receiver.hands?);
    let other_hand = |is_posed: bool| is_posed.then(|| hands.other.clone());
    let Thesis {
        validity,
        strategy,
        bend_ratios,
        record_step_times,
    } = requirements.thesis;
    Some(FindQuery {
        object_id,
        object_size: holdout.object_size,
        convention,
        client_from_object,
        presenting_hand: holdout.presenting_hand,
        other_hands: holdout.other_hands,
        obstacles: holdout.obstacles.solids,
        obstacle_places: holdout.obstacles.places,
        alternative_hand: other_hand(receiver.chooses_hand),
        other_hand: other_hand(receiver.takes_both_hands),
        receiving_hand: hands.hand,
        stances: receiver.stances,
        up: holdout.up,
        limits: search.limits,
        strategy,
        validity,
        bend_ratios,
        seed: search.seed,
        reproducible: search.reproducible,
        record_step_times,
        friction: requirements.friction,
        requirements: requirements.requirements,
        choice: search.choice,
        allows_atlas: search.allows_atlas,
        is_replay: search.is_replay,
        plan_key_frames: output.plan_key_frames,
        changes_only: output.changes_only,
        current,
        recent_hands: Arc::default(),
    })
}

/// Adds to other violations that the object does not exist.
fn check_exists(holdout: Field<'_>, id: Option<&str>, object_exists: impl Fn(&str) -> bool) {
    if let (true, Some(id)) = (!holdout.violations().is_empty(), id)
        && !object_exists(id)
    {
        holdout
            .child("object")
            .add(format_args!("objects/{id} does not exist"));
    }
}

/// A replay needs a hand: the attempts of left and right differ.
fn check_replay(field: Field<'_>, is_replay: bool, receiver: &Receiver) {
    if is_replay && receiver.chooses_hand {
        field.child("handedness").add(
            "is unspecified with replay_attempt, which each hand has of its own; name the hand of the grasp to replay",
        );
    }
}

/// Both hands take an object only in searches that are not of the thesis, and without a planned motion.
fn check_both_hands(field: Field<'_>, thesis: Thesis, plan_key_frames: bool) {
    if !thesis.is_default() {
        field.child("both_hands").add(
            "is true with thesis_validity or a strategy of the thesis, which know one hand; leave one of them out",
        );
    }
    if plan_key_frames {
        field
            .violations()
            .field("output")
            .child("key_frames")
            .add("is true with both_hands, for which no motion is planned; leave one of them out");
    }
}

#[cfg(test)]
mod tests;
