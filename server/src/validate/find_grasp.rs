//! Checks `FindGraspRequest`, and the parts that other requests share with it.

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::{
        hand::Handedness,
        holdout::Obstacle,
        strategy::{Choice, Strategy, Validity},
    },
    search::settings::{Query, Run},
};

use super::{
    Field, GiverHand, Violations,
    current_grasp::{Context, CurrentGraspQuery, current_grasp},
    holdout::{Frames, RequestedSize, convention_of_output, holdout},
    receiver::{Stances, Surroundings, chooses_hand, receiving_hands, stances},
    required,
    requirements::{SearchLimits, requirements, search, validity},
};
use crate::{
    convention::Convention,
    error::ServiceError,
    rigs::{RigHand, store::RigStore},
};

#[derive(Clone, Debug)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "the request's switches are independent"
)]
pub(crate) struct FindQuery {
    pub object_id: String,
    pub object_size: RequestedSize,
    pub convention: Convention,
    /// Pose of the object in the client's frame, in `OpenXR` axes.
    pub client_from_object: Pose,
    pub presenting_hand: Option<GiverHand>,
    /// Further hands to keep clear of, in the client's frame and `OpenXR` axes.
    pub other_hands: Vec<GiverHand>,
    /// Obstacles to keep clear of, in the client's frame and `OpenXR` axes. A long tube is several.
    pub obstacles: Vec<Obstacle>,
    /// The place in the request of each of them.
    pub obstacle_places: Vec<usize>,
    pub receiving_hand: RigHand,
    /// The hand that may be posed in its place: the request leaves the choice to the search.
    pub alternative_hand: Option<RigHand>,
    pub other_hand: Option<RigHand>,
    pub stances: Stances,
    /// Direction against gravity in the client's frame, in `OpenXR` axes: a unit vector.
    pub up: Vec3,
    /// The search for one hand in the client's frame and `OpenXR` axes, without refinement, current grasp and receiver's reach.
    pub search: Query,
    /// How to run it, without seed, deadline and workers.
    pub run: Run,
    pub limits: SearchLimits,
    pub seed: Option<u64>,
    /// True unless the request excludes the atlas.
    pub allows_atlas: bool,
    pub is_replay: bool,
    pub plan_key_frames: bool,
    /// True to answer only the changes of a grasp that is kept.
    pub changes_only: bool,
    /// Also send grasps packed.
    pub packs: bool,
    pub current: Option<CurrentGraspQuery>,
}

impl FindQuery {
    pub(crate) fn uses_atlas(&self) -> bool {
        self.allows_atlas && self.search.uses_known_grips()
    }

    pub(crate) fn has_hand_mesh(&self) -> bool {
        let mut hands = self.presenting_hand.iter().chain(&self.other_hands);
        hands.any(|hand| matches!(hand, GiverHand::Meshed(_)))
    }

    pub(crate) fn keep_hand(&mut self, side: Handedness) {
        if let Some(other) = self.alternative_hand.take()
            && other.hand.rig.handedness == side
        {
            self.receiving_hand = other;
        }
    }
}

/// Checks a request. An id for which `object_exists` is false is a violation if there are others; without others, it is
/// left to the look-up, which knows about evicted objects.
pub(crate) fn find_query(
    request: v1::FindGraspRequest,
    rigs: (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<FindQuery, ServiceError> {
    let v = &Violations::default();
    v.finish_some(checked_query(request, rigs, object_exists, v))
}

fn choice(sent: v1::GraspChoice) -> Choice {
    match sent {
        v1::GraspChoice::BestWithinBudget => Choice::BestWithinBudget,
        _ => Choice::FirstValid,
    }
}

/// Only searches whose grasps can be kept take a current one.
fn check_may_keep(field: Field<'_>, is_guided: bool, takes_both_hands: bool, is_replay: bool) {
    field.check(
        is_guided,
        "is set with thesis_validity or a strategy of the thesis, which keep no grasp; leave one of them out",
    );
    field.check(!takes_both_hands, "is of one hand; leave it or both_hands out");
    let text = "cannot be combined with replay_attempt, which runs that attempt; use one of them";
    field.check(!is_replay, text);
}

/// The query of a request, or of the parts of another one that both have; `None` only with violations.
pub(super) fn checked_query(
    request: v1::FindGraspRequest,
    (default_rig, rigs): (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
    v: &Violations,
) -> Option<FindQuery> {
    let (holdout_field, receiver_field) = (v.field("holdout"), v.field("receiver"));
    let output = request.output.unwrap_or_default();
    let convention = convention_of_output(v.field("output"), output);
    let validity = validity(request.requirements.as_ref());
    let holdout = required(holdout_field, request.holdout)
        .map(|sent| holdout(holdout_field, sent, validity, (convention, rigs)));
    let surroundings = Surroundings {
        convention,
        object: holdout.as_ref().and_then(|holdout| holdout.origin),
        validity,
    };
    let receiver = request.receiver.unwrap_or_default();
    let hands = receiving_hands(receiver_field, &receiver, validity, (default_rig, rigs));
    let receiving_hand = hands.as_ref().map(|[hand, _]| hand);
    let chooses_hand = chooses_hand(&receiver, validity);
    // One with a wrong body faces the giver.
    let stances = stances(receiver_field, &receiver, surroundings).unwrap_or_default();
    let sent = request.requirements.unwrap_or_default();
    let query = requirements(
        v.field("requirements"),
        &sent,
        (validity, convention),
        receiving_hand,
    );
    let is_guided = (query.strategy, validity) == (Strategy::Guided, Validity::Physical);
    if receiver.both_hands {
        receiver_field.child("both_hands").check(
            is_guided,
            "is true with thesis_validity or a strategy of the thesis, which know one hand; leave one of them out",
        );
        let text = "is true with both_hands, for which no motion is planned; leave one of them out";
        v.field("output")
            .child("key_frames")
            .check(!output.key_frames, text);
    }
    let record_step_times = sent.thesis.is_some_and(|thesis| thesis.record_step_times);
    let sent = request.search.unwrap_or_default();
    let (limits, run) = search(v.field("search"), &sent);
    let is_replay = sent.replay_attempt.is_some();
    // The attempts of left and right differ.
    receiver_field.child("handedness").check(
        !(is_replay && chooses_hand),
        "is unspecified with replay_attempt, which each hand has of its own; name the hand of the grasp to replay",
    );
    let context = Context {
        frames: Frames {
            convention,
            client_from_object: holdout
                .as_ref()
                .map_or(Pose::IDENTITY, |of| of.client_from_object),
            rigs,
        },
        receiving_hand,
        chooses_hand,
    };
    let current_field = v.field("current");
    if request.current.is_some() {
        check_may_keep(current_field, is_guided, receiver.both_hands, is_replay);
    }
    let current = current_grasp(current_field, request.current, &context);
    let holdout = holdout?;
    let object_id = holdout.object_id?;
    if !v.is_empty() && !object_exists(&object_id) {
        holdout_field
            .child("object")
            .add(format_args!("objects/{object_id} does not exist"));
    }
    let [hand, other] = hands?;
    let other_hand = |is_posed: bool| is_posed.then(|| other.clone());
    Some(FindQuery {
        object_id,
        object_size: holdout.object_size,
        convention,
        client_from_object: holdout.client_from_object,
        presenting_hand: holdout.presenting_hand,
        other_hands: holdout.other_hands,
        obstacles: holdout.obstacles,
        obstacle_places: holdout.obstacle_places,
        alternative_hand: other_hand(chooses_hand),
        other_hand: other_hand(receiver.both_hands),
        receiving_hand: hand,
        stances,
        up: holdout.up,
        search: Query {
            choice: choice(sent.choice()),
            other_hand: receiver.both_hands.then(|| other.hand.rig.clone()),
            ..query
        },
        run: Run {
            record_step_times,
            ..run
        },
        limits,
        seed: sent.seed,
        allows_atlas: !sent.ignore_atlas,
        is_replay,
        plan_key_frames: output.key_frames,
        changes_only: output.changes_only,
        packs: output.packed,
        current,
    })
}
