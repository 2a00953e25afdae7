//! The part of a search that is about grips which its object's owner prefers.

use grasp_synthesis::search::{GraspSource, preferred::passed_over, standing::Fall};

use super::PreparedJob;
use crate::search::progress::HandPlace;

impl PreparedJob {
    /// Names of the preferred grips that were tried before an answer with one hand, and why they are none.
    pub(super) fn passed_over(&self, answered: HandPlace, source: Option<GraspSource>) -> Vec<(&str, Fall)> {
        if source == Some(GraspSource::Standing) {
            return Vec::new();
        }
        let mut all = Vec::new();
        for (place, search) in self.hands.iter().enumerate() {
            let count = match source {
                Some(GraspSource::Preferred(index)) if place == answered => usize::from(index),
                _ => usize::MAX,
            };
            let falls = passed_over(self.task(place), &search.settings, count).into_iter();
            all.extend(falls.map(|(index, fall)| (search.preferred[index].as_str(), fall)));
        }
        all
    }
}
