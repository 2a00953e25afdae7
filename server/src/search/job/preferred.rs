//! The part of a search that is about grips which its object's owner prefers.

use grasp_synthesis::search::{GraspSource, current::FailedCheck, preferred::passed_over};

use super::PreparedJob;
use crate::search::progress::HandPlace;

impl PreparedJob {
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
}
