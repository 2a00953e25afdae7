//! What an answer says besides its grasp: where that came from, what was passed over, what is to be learned, and what keeps a
//! search from finding one.

use std::sync::Arc;

use grasp_assets::hands::Hand;
use grasp_proto::v1;
use grasp_synthesis::{
    known::entry::Entry,
    model::strategy::Validity,
    search::{
        GraspSource, SearchOutcome,
        current::{FailedCheck, passed_over},
        limits::{Limit, known_limit, limits},
    },
};

use super::{HandSearch, PreparedJob};
use crate::{
    answer::{atlas_used, wire_origin},
    search::progress::HandPlace,
};

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
    /// Where an answer with one hand came from, and what is known for each hand, that one first.
    pub(in crate::search) fn origin(
        &self,
        answered: HandPlace,
        source: Option<GraspSource>,
    ) -> v1::GraspOrigin {
        let HandSearch {
            settings, preferred, ..
        } = &self.hands[answered];
        let others = (0..self.hands.len()).filter(|&place| place != answered);
        let hands = std::iter::once(answered).chain(others);
        v1::GraspOrigin {
            known_grip: match source {
                Some(GraspSource::Preferred(index)) => preferred[usize::from(index)].clone(),
                _ => String::new(),
            },
            atlases: hands.filter_map(|place| self.atlas_used(place)).collect(),
            ..wire_origin(source, settings.run.seed)
        }
    }

    /// The atlas that the search with a hand uses; `None` if nothing is known.
    pub(in crate::search) fn atlas_used(&self, place: HandPlace) -> Option<v1::Atlas> {
        let HandSearch { hand, settings, .. } = &self.hands[place];
        atlas_used(&self.query.object_id, hand.hand.rig.handedness, settings)
    }

    /// Names of the preferred grips that were tried before an answer with one hand, and why they are none.
    pub(super) fn passed_over(
        &self,
        answered: HandPlace,
        source: Option<GraspSource>,
    ) -> Vec<(&str, FailedCheck)> {
        if source == Some(GraspSource::Current) {
            return Vec::new();
        }
        let mut all = Vec::new();
        for (place, search) in self.hands.iter().enumerate() {
            let count = match source {
                Some(GraspSource::Preferred(index)) if place == answered => usize::from(index),
                _ => usize::MAX,
            };
            let failures = passed_over(self.task(place), &search.settings, count).into_iter();
            all.extend(failures.map(|(index, failed)| (search.preferred[index].as_str(), failed)));
        }
        all
    }

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
        if !self.learns() || !is_new || settings.query.friction_on(&holdout.object) != own_friction {
            return None;
        }
        let entry = Entry::of_grasp(outcome.grasp.as_ref()?)?;
        Some((Arc::clone(&hand.hand), entry))
    }

    /// What keeps a hand from holding the object. Of two hands, each has to be limited; both limit mostly the same. Without proof,
    /// known grips say what is in the way; a hand without any is taken to be like the other.
    pub(in crate::search) fn limits(&self) -> Vec<Limit> {
        let hands = || self.hands.iter().enumerate();
        let proven = of_each(hands().map(|(place, search)| limits(self.task(place), &search.settings.query)));
        if !proven.is_empty() {
            return proven;
        }
        let knows = |search: &HandSearch| {
            let atlas = search.settings.known.atlas.as_ref();
            atlas.is_some_and(|atlas| !atlas.entries().is_empty())
        };
        let none_knows = !self.hands.iter().any(knows);
        let judged = hands().filter(|(_, search)| none_knows || knows(search));
        of_each(judged.map(|(place, search)| {
            let limit = known_limit(self.task(place), &search.settings);
            limit.into_iter().collect()
        }))
    }
}

/// The limits of all hands, one of each kind; `None` if a hand has none.
fn of_each(hands: impl Iterator<Item = Vec<Limit>>) -> Vec<Limit> {
    let mut all: Vec<Limit> = Vec::new();
    for of_hand in hands {
        if of_hand.is_empty() {
            return of_hand;
        }
        let new = |limit: &Limit| all.iter().all(|known| known.check != limit.check);
        let new: Vec<Limit> = of_hand.into_iter().filter(new).collect();
        all.extend(new);
    }
    all
}
