//! The part of a search that is about where its grasp came from.

use grasp_proto::v1;
use grasp_synthesis::search::GraspSource;

use super::{HandSearch, PreparedJob};
use crate::{
    answer::{atlas_used, wire_origin},
    search::progress::HandPlace,
};

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

    /// The atlas that the search with a hand uses; none if nothing is known.
    pub(in crate::search) fn atlas_used(&self, place: HandPlace) -> Option<v1::Atlas> {
        let HandSearch { hand, settings, .. } = &self.hands[place];
        atlas_used(&self.query.object_id, hand.hand.rig.handedness, settings)
    }
}
