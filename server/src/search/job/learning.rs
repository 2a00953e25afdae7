//! The part of a search that is about what its object's atlas lacks.

use std::sync::Arc;

use grasp_assets::hands::Hand;
use grasp_synthesis::{
    known::entry::Entry,
    model::strategy::Validity,
    search::{GraspSource, SearchOutcome},
};

use super::{HandSearch, PreparedJob};
use crate::search::progress::HandPlace;

/// How a known grip of one hand ranks against one of the other: preferred ones first, those of atlases before learned ones.
pub(super) fn rank(outcome: &SearchOutcome) -> (bool, bool, bool, f32) {
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

impl PreparedJob {
    /// The grip to learn: one that an attempt found under the object's own friction and size, which known grips are for.
    pub(super) fn new_grip(&self, outcome: &SearchOutcome, place: HandPlace) -> Option<(Arc<Hand>, Entry)> {
        let HandSearch {
            hand,
            holdout,
            settings,
            ..
        } = &self.hands[place];
        let own_friction = holdout.object.friction_under(Validity::Physical);
        let is_new = matches!(outcome.report.source, Some(GraspSource::Attempt(_)));
        if !self.learns || !is_new || settings.query.friction_on(&holdout.object) != own_friction {
            return None;
        }
        let entry = Entry::of_grasp(outcome.grasp.as_ref()?)?;
        Some((Arc::clone(&hand.hand), entry))
    }
}
