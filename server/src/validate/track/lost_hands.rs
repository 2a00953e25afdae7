//! Hands of a track that have lost tracking for a frame or more: headsets send zeros then, or joints in impossible places.

use grasp_proto::v1::{self, presenting_hand::Form};

use crate::{
    rigs::store::RigStore,
    validate::{Field, FindQuery, GiverHand, Violations, frames::Frames, hand},
};

/// The hands of a track where they were last.
#[derive(Debug, Default)]
pub(super) struct LastHands {
    /// Whether there was a frame without lost ones.
    is_known: bool,
    /// The giver's, in the object's frame: it holds the object.
    giver: Option<GiverHand>,
    /// The others, in the client's frame.
    others: Vec<GiverHand>,
}

/// Which hands of a frame have lost tracking.
#[derive(Debug, Default)]
pub(super) struct LostHands {
    giver: bool,
    /// By their places in the frame.
    others: Vec<usize>,
}

impl LostHands {
    /// Takes the hands that have lost tracking out of a holdout, and adds why.
    pub(super) fn take_from(
        parent: Field<'_>,
        holdout: &mut v1::Holdout,
        output: Option<v1::OutputOptions>,
        rigs: &RigStore,
    ) -> Self {
        let frames = Frames::of(Some(holdout), output, rigs);
        let mut lost = Self::default();
        let presenting = holdout.presenting_hand.take_if(|hand| {
            let field = parent.child("presenting_hand");
            is_lost(field, hand, &frames)
        });
        lost.giver = presenting.is_some();
        let mut place = 0;
        holdout.other_hands.retain(|hand| {
            let field = parent.child("other_hands").at(place);
            let is_lost = is_lost(field, hand, &frames);
            if is_lost {
                lost.others.push(place);
            }
            place += 1;
            !is_lost
        });
        lost
    }

    /// True if nothing is known of the giver's hand.
    pub(super) fn is_without_giver(&self, last: &LastHands) -> bool {
        self.giver && !last.is_known
    }

    /// Puts them where they were last. Others that were never seen stay absent.
    pub(super) fn put_back(&self, last: &LastHands, query: &mut FindQuery) {
        if self.giver
            && let Some(mut giver) = last.giver.clone()
        {
            giver.move_by(query.client_from_object);
            query.presenting_hand = Some(giver);
        }
        for &place in &self.others {
            if let Some(hand) = last.others.get(place) {
                query
                    .other_hands
                    .insert(place.min(query.other_hands.len()), hand.clone());
            }
        }
    }
}

impl LastHands {
    /// Remembers the hands of a frame.
    pub(super) fn learn(&mut self, query: &FindQuery) {
        let object_from_client = query.client_from_object.inverse();
        self.is_known = true;
        self.giver = query.presenting_hand.clone().map(|mut giver| {
            giver.forget_warnings();
            giver.move_by(object_from_client);
            giver
        });
        self.others.clone_from(&query.other_hands);
    }
}

/// True if a hand is well-formed but nowhere that a hand can be. Adds why.
fn is_lost(field: Field<'_>, sent: &v1::PresentingHand, frames: &Frames<'_>) -> bool {
    let may_be_lost = match &sent.form {
        Some(Form::Joints(joints)) => is_well_formed(joints),
        Some(Form::Pose(_)) => true,
        Some(Form::Mesh(_)) | None => false,
    };
    if !may_be_lost {
        return false;
    }
    let of_hand = Violations::default();
    hand::presenting_hand(field.among(&of_hand), sent.clone(), frames);
    let is_only_placed_wrongly = match &sent.form {
        Some(Form::Pose(_)) => of_hand.are_all_of("client_from_wrist"),
        _ => true,
    };
    let is_lost = !of_hand.is_empty() && is_only_placed_wrongly;
    if is_lost {
        field.violations().add_all("", of_hand);
    }
    is_lost
}

/// True if the joints are as many as they should be, or none, of a known side.
fn is_well_formed(sent: &v1::HandJoints) -> bool {
    let has_side = matches!(sent.handedness(), v1::Handedness::Left | v1::Handedness::Right);
    has_side && matches!(sent.joints.len(), 0 | 25 | 26)
}
